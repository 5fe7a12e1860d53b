"""From streams to windows: the one definition of a push window, used offline and online (contract, section 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

TIMED_ID = "push-"  # begins the id of a push that is named by the time of its first touch


@dataclass(frozen=True)
class WindowOptions:
    """How windows are cut. Lengths in m, times in s, speeds in m/s, forces in N.

    stride: from one window's start to the next one's; None tiles them end to end.
    touch_gap: largest distance between pusher and outline that may be contact where a force tells;
    touch_gap_alone: the same where no force was recorded. least_force: what the force must exceed, beside five
    standard deviations of its noise in free motion. least_speed: below it the pusher rests.
    lift: a tip this far above the slider's frame is lifted. bounce: a loss of contact shorter than this is none.
    push_pause: after no contact or no motion for this long, the next contact is another push.
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
    """One window: what the pusher did and what the slider did.

    start, end: header time, ns. velocity m/s, contact, angle rad, duration s as in contract section 1.
    displacement (3,): dx, dy m, dtheta rad in the push frame. slider_start, slider_end (3,): x, y m, heading rad in
    the world. push_heading: the push frame's x axis in the world, rad. covariates: conditions of the window.
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
    """The windows as rows; a covariate is kept where every window has it."""
    names = [name for name in (windows[0].covariates if windows else ()) if all(name in w.covariates for w in windows)]
    return PushTable(
        np.array([[w.velocity, w.contact, w.angle] for w in windows]).reshape(-1, 3),
        np.array([w.duration for w in windows]),
        np.array([w.displacement for w in windows]).reshape(-1, 3),
        np.array([w.push_id for w in windows], dtype=np.str_),
        {name: np.array([w.covariates[name] for w in windows]) for name in names},
    )
