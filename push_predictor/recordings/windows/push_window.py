# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The push window: its options and its fields (docs/explanation/windows.md)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray, TextArray

TIMED_ID = "push-"  # prefix of ids that contain the time of first touch
_STAMP = re.compile(rf"(?:^|/){TIMED_ID}(\d+)\.(\d{{3}})$")  # s and ms; the name of a file may come before


@dataclass(frozen=True)
class WindowOptions:
    """Options of the window finder. Lengths in m, times in s, speeds in m/s, forces in N.

    duration: length of a window. stride: time from one start to the next; None tiles windows end to end.
    touch_gap: largest gap between pusher and outline in contact, where the force confirms it; touch_gap_alone: the
    same without a force. least_force: the force in contact exceeds this and five standard deviations of its noise in
    free motion. least_speed: a slower pusher is at rest. lift: a tip this far above the slider's frame is lifted.
    bounce: shorter losses of contact are ignored. push_pause: after no contact or no motion for this long, the next
    contact is another push.
    """

    duration: float = 0.2
    stride: float | None = None
    touch_gap: float = 0.003
    touch_gap_alone: float = 0.001
    least_force: float = 0.1
    least_speed: float = 0.0015
    lift: float = 0.02
    bounce: float = 0.04
    push_pause: float = 0.3


@dataclass(frozen=True, eq=False)
class PushWindow:
    """One window: the command of the pusher and the displacement of the slider.

    start, end: header time, ns. velocity m/s, contact, angle rad and duration s as in docs/reference/push.md.
    displacement (3,): dx, dy m, dtheta rad in the push frame. slider_start, slider_end (3,): x, y m, heading rad in
    the world. push_heading: heading of the push frame's x axis in the world, rad. covariates: values by name.
    """

    push_id: str
    index: int
    start: int
    end: int
    velocity: float
    contact: float
    angle: float
    duration: float
    displacement: Array
    slider_start: Array
    slider_end: Array
    push_heading: float
    covariates: dict[str, float]


def windows_to_table(windows: Sequence[PushWindow]) -> PushTable:
    """The windows as rows of a table; a covariate is kept if every window has it."""
    names = [name for name in (windows[0].covariates if windows else ()) if all(name in w.covariates for w in windows)]
    return PushTable(
        np.array([[w.velocity, w.contact, w.angle] for w in windows]).reshape(-1, 3),
        np.array([w.duration for w in windows]),
        np.array([w.displacement for w in windows]).reshape(-1, 3),
        np.array([w.push_id for w in windows], dtype=np.str_),
        {name: np.array([w.covariates[name] for w in windows]) for name in names},
    )


def first_touches(push_id: TextArray) -> IntArray | None:
    """The stamps (n,) ns, to a millisecond, of first touch in the ids (n,) of pushes; None unless all have one."""
    names, row = np.unique(push_id, return_inverse=True)
    found = [match for name in names.tolist() if (match := _STAMP.search(name))]
    if len(found) < len(names):
        return None
    return np.array([int(m[1]) * 10**9 + int(m[2]) * 10**6 for m in found], dtype=np.int64)[row]
