"""When is a push complete, and every window of it answered? Pushes pass in the order in which they were found."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from push_predictor.models.push_model import Prediction
from push_predictor.online.alarm_process import JudgedPush
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table


@dataclass
class _Open:
    """A push: its windows by number, those answered, and how many are neither answered nor refused."""

    push_id: str
    answered: dict[int, tuple[PushWindow, Prediction]] = field(default_factory=dict)
    missing: set[int] = field(default_factory=set)


class PushGate:
    """Collects the windows of the main model until a push is complete."""

    def __init__(self) -> None:
        self._open: deque[_Open] = deque()
        self._of: dict[int, _Open] = {}

    def found(self, number: int, window: PushWindow) -> None:
        """A window was found."""
        if not self._open or self._open[-1].push_id != window.push_id:
            self._open.append(_Open(window.push_id))
        self._open[-1].missing.add(number)
        self._of[number] = self._open[-1]

    def answered(self, number: int, window: PushWindow, prediction: Prediction | None) -> None:
        """A window was predicted, or (None) refused."""
        push = self._of.pop(number, None)
        if push is None:
            return  # it came after the push had to pass without it
        push.missing.discard(number)
        if prediction is not None:
            push.answered[number] = (window, prediction)

    def passed(self, last: bool = False) -> list[JudgedPush]:
        """The pushes that are complete: another was found since. last: there will be no more windows and answers."""
        done = []
        while self._open and (last or (len(self._open) > 1 and not self._open[0].missing)):
            push = self._open.popleft()
            for number in push.missing:
                self._of.pop(number, None)
            if push.answered:
                done.append(_judged(push))
        return done


def _judged(push: _Open) -> JudgedPush:
    rows = [push.answered[number] for number in sorted(push.answered)]
    windows = [window for window, _ in rows]
    mean, covariance = np.stack([p.mean[0] for _, p in rows]), np.stack([p.covariance[0] for _, p in rows])
    return JudgedPush(windows_to_table(windows), mean, covariance, windows[-1].end)
