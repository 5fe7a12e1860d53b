# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""When a push is complete, and the alarm gets its windows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from made_up_windows import made_up_windows

from push_predictor.models.prediction import Prediction
from push_predictor.online.alarm_process import CompletedPush, CompletedPushes

NOWHERE = Prediction(np.zeros((1, 3)), np.eye(3)[None], np.eye(3)[None], np.array([True]))


def ends(pushes: list[CompletedPush]) -> list[tuple[str, int]]:
    """Name and number of windows of each push."""
    assert all(push.mean.shape == (len(push.windows), 3) for push in pushes)
    return [(push.windows.push_id[0], len(push.windows)) for push in pushes]


def test_a_push_is_complete_when_all_its_windows_are_answered_and_another_has_begun() -> None:
    windows = [replace(w, push_id=name) for w, name in zip(made_up_windows(5), "aabbc", strict=True)]
    pushes = CompletedPushes()
    for number in (0, 1):
        pushes.found(number, windows[number])
        pushes.answered(number, windows[number], NOWHERE)
    assert ends(pushes.take()) == [], "it may go on"
    for number in (2, 3):
        pushes.found(number, windows[number])
    pushes.answered(2, windows[2], NOWHERE)
    assert ends(pushes.take()) == [("a", 2)]
    pushes.found(4, windows[4])
    assert ends(pushes.take()) == [], "a window of b has no answer yet"
    pushes.answered(3, windows[3], None)
    assert ends(pushes.take()) == [("b", 1)], "it was refused"
    pushes.answered(4, windows[4], NOWHERE)
    assert ends(pushes.take(last=True)) == [("c", 1)]
    pushes.answered(4, windows[4], NOWHERE)
    assert ends(pushes.take(last=True)) == [], "too late"
