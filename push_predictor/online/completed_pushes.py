# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The complete pushes, with every window answered, in the order in which they were found."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from push_predictor.models.prediction import Prediction
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class CompletedPush:
    """The n answered windows of one push, their predictions (n, 3) and (n, 3, 3), and the push's end (ns)."""

    windows: PushTable
    mean: Array
    covariance: Array
    end: int


@dataclass
class _OpenPush:
    """A push: its predicted windows by number, and the numbers that are neither predicted nor refused yet."""

    push_id: str
    predicted: dict[int, tuple[PushWindow, Prediction]] = field(default_factory=dict)
    missing: set[int] = field(default_factory=set)


class CompletedPushes:
    """Collects the windows of the main model until their push is complete."""

    def __init__(self) -> None:
        self._open: deque[_OpenPush] = deque()
        self._push_of: dict[int, _OpenPush] = {}

    def found(self, number: int, window: PushWindow) -> None:
        """Note that a window was found."""
        if not self._open or self._open[-1].push_id != window.push_id:
            self._open.append(_OpenPush(window.push_id))
        self._open[-1].missing.add(number)
        self._push_of[number] = self._open[-1]

    def answered(self, number: int, window: PushWindow, prediction: Prediction | None) -> None:
        """Note that a window was predicted, or (None) refused."""
        push = self._push_of.pop(number, None)
        if push is None:
            return  # too late: the push has left without it
        push.missing.discard(number)
        if prediction is not None:
            push.predicted[number] = (window, prediction)

    def take(self, last: bool = False) -> list[CompletedPush]:
        """Remove and return the complete pushes: another was found since. last: neither windows nor answers follow."""
        done = []
        while self._open and (last or (len(self._open) > 1 and not self._open[0].missing)):
            push = self._open.popleft()
            for number in push.missing:
                self._push_of.pop(number, None)
            if push.predicted:
                done.append(_completed(push))
        return done


def _completed(push: _OpenPush) -> CompletedPush:
    rows = [push.predicted[number] for number in sorted(push.predicted)]
    windows = [window for window, _ in rows]
    mean, covariance = np.stack([p.mean[0] for _, p in rows]), np.stack([p.covariance[0] for _, p in rows])
    return CompletedPush(windows_to_table(windows), mean, covariance, windows[-1].end)
