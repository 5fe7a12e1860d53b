# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The diagnostic status of a predict_server (docs/reference/predict_server.md), and the statistics of its requests."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import diagnostic_status
from push_predictor.models.store.model_registry import ModelRegistry

NO_MODEL = "no model is loaded: set the parameter 'models' or call load_model"
KEPT = 2000  # callbacks that the percentiles cover


def server_status(
    node_name: str, state: str, registry: ModelRegistry, problems: Sequence[str], statistics: RequestStatistics
) -> DiagnosticStatus:
    """The status of a node in a lifecycle state; problems: one line per model that could not be loaded."""
    level, message = _health(state, registry, problems)
    values = {
        "state": state,
        "models": registry.names,
        "default_model": registry.default,
        "answers": registry.answering,
        "problems": "; ".join(problems) or None,
        **statistics.values(),
    }
    return diagnostic_status(node_name, "predictions", level, message, values, registry.default)


def _health(state: str, registry: ModelRegistry, problems: Sequence[str]) -> tuple[bytes, str]:
    if not registry.names:
        return DiagnosticStatus.ERROR, NO_MODEL
    if state != "active":
        return DiagnosticStatus.WARN, f"the node is {state}"
    if registry.default not in registry.names:
        return DiagnosticStatus.WARN, f"default_model {registry.default!r} is not loaded"
    if problems:
        return DiagnosticStatus.WARN, f"models that could not be loaded: {len(problems)}, listed under problems"
    return DiagnosticStatus.OK, f"models loaded: {len(registry.names)}"


class RequestStatistics:
    """Counts and callback times; safe to use from any thread, with bounded memory."""

    def __init__(self) -> None:
        self._served = self._refused = 0
        self._last_refusal: str | None = None
        self._seconds: deque[float] = deque(maxlen=KEPT)
        self._lock = threading.Lock()

    def add(self, seconds: float, refusal: str | None) -> None:
        """Count one request. seconds: time in the callback; refusal: the reason, None if it was answered."""
        with self._lock:
            self._seconds.append(seconds)
            if refusal is None:
                self._served += 1
            else:
                self._refused += 1
                self._last_refusal = refusal

    def values(self) -> dict[str, object]:
        """Named values for a diagnostic status; times in microseconds over the last KEPT requests."""
        with self._lock:
            seconds = list(self._seconds)
            served, refused, last = self._served, self._refused, self._last_refusal
        p50, p99 = np.percentile(seconds, [50, 99]) * 1e6 if seconds else (None, None)
        return {
            "requests_served": served,
            "requests_refused": refused,
            "last_refusal": last,
            "callback_p50_us": p50,
            "callback_p99_us": p99,
        }
