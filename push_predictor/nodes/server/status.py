# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The diagnostic status of a predict_server (docs/reference/predict_server.md, "Diagnostics")."""

from __future__ import annotations

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from msg_adapters.diagnostics import Level, diagnostic_status
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.online.request_statistics import RequestStatistics

NO_MODEL = "no model is loaded: set the parameter 'models' or call load_model"


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


def _health(state: str, registry: ModelRegistry, problems: Sequence[str]) -> tuple[Level, str]:
    if not registry.names:
        return Level.ERROR, NO_MODEL
    if state != "active":
        return Level.WARN, f"the node is {state}"
    if registry.default not in registry.names:
        return Level.WARN, f"default_model {registry.default!r} is not loaded"
    if problems:
        return Level.WARN, f"models that could not be loaded: {len(problems)}, listed under problems"
    return Level.OK, f"models loaded: {len(registry.names)}"
