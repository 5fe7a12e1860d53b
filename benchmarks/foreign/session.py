# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A session: true paths of tip, slider and force over the whole recording, before any sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.motion import PushMotion
from benchmarks.foreign.plan import CLEARANCE_TIME, ENTRY_TIME, TRANSFER_TIME, Plan
from benchmarks.foreign.rig import Rig
from benchmarks.support.plane import Array, BoolArray, direction, wrapped

LOW, HIGH = 0.012, 0.055  # m, heights of the tip
CIRCLE = 0.32  # m, radius on which a tip that drives back goes around the table
RESET_TIME = 0.4  # s
UNLOADING_TIME = {"lift": 0.015, "drive_back": 0.003}  # s, until the force of the last contact is gone
UNTOUCHED = 0.0005  # s before first touch at which the force is still zero

Knots = list[tuple[float, Array]]


@dataclass(frozen=True)
class Track:
    """A signal that is linear between its knots: `time` s, `values` shape (knots, components)."""

    time: Array
    values: Array

    def at(self, time: Array) -> Array:
        """Values at `time`, held constant beyond the ends."""
        columns = [np.interp(time, self.time, column) for column in self.values.T]
        return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Session:
    """True signals: tip centre as the robot's encoders see it (m), slider (m, m, rad), force and torque on the slider.

    `slider` headings are continuous. `duration` is the length in s; `gaps` are the intervals without recording.
    """

    pusher: Track
    slider: Track
    force: Track
    duration: float
    gaps: Array

    def recorded(self, time: Array) -> BoolArray:
        """Which instants lie outside the gaps of the recording."""
        keep = np.ones(len(time), bool)
        for first, last in self.gaps:
            keep &= (time < first) | (time > last)
        return keep


def lay_out(rig: Rig, plan: Plan, motion: PushMotion) -> Session:
    """Join the pushes of a plan into one session."""
    clear = plan.release + CLEARANCE_TIME[rig.retreat]
    paused = plan.unrecorded > 0
    gaps = np.column_stack([clear + 0.05, clear + 0.05 + plan.unrecorded])[paused]
    return Session(
        pusher=_pusher_track(rig, plan, motion),
        slider=_slider_track(rig, plan, motion),
        force=_force_track(rig, plan, motion),
        duration=float(clear[-1] + 1.0),
        gaps=gaps,
    )


def _pusher_track(rig: Rig, plan: Plan, motion: PushMotion) -> Track:
    """Path of the robot: along the push, clear of the slider, over or around to the next push."""
    ahead = direction(motion.heading)
    begin = motion.touch - plan.approach[:, None] * ahead
    end = motion.touch + plan.travel[:, None] * ahead
    transfer = _around if rig.retreat == "drive_back" else _over
    knots = [(0.0, _high(begin[0]) if rig.retreat == "lift" else _low(_outside(begin[0], ahead[0])))]
    for push in range(len(plan)):
        knots += [(plan.start[push], _low(begin[push])), (plan.release[push] - plan.hold[push], _low(end[push]))]
        knots.append((plan.release[push], _low(end[push])))
        if push + 1 < len(plan):
            leave, arrive = plan.release[push], plan.start[push + 1]
            knots += transfer(leave, arrive, end[push], begin[push + 1], ahead[push], ahead[push + 1])
        else:
            knots.append((plan.release[push] + 0.25, _high(end[push])))
    return Track(np.array([time for time, _ in knots]), np.array([place for _, place in knots]))


def _low(place: Array) -> Array:
    return np.append(place, LOW)


def _high(place: Array) -> Array:
    return np.append(place, HIGH)


def _outside(place: Array, ahead: Array) -> Array:
    """Where the line through `place` comes in from the circle around the table."""
    along = float(place @ ahead)
    return np.asarray(place - (along + np.sqrt(along**2 + CIRCLE**2 - place @ place)) * ahead)


def _over(leave: float, arrive: float, end: Array, begin: Array, _away: Array, _ahead: Array) -> Knots:
    """Lift, wait, cross above the slider, come down."""
    down = arrive - ENTRY_TIME["lift"]
    return [
        (leave + CLEARANCE_TIME["lift"], _high(end)),
        (down - TRANSFER_TIME["lift"], _high(end)),
        (down, _high(begin)),
    ]


def _around(leave: float, arrive: float, end: Array, begin: Array, away: Array, ahead: Array) -> Knots:
    """Drive back to the circle, wait, follow the circle, come in on the next push's line."""
    out, back = _outside(end, away), _outside(begin, ahead)
    angle, target = np.arctan2(out[1], out[0]), np.arctan2(back[1], back[0])
    swept = angle + wrapped(target - angle) * np.linspace(0, 1, 13)
    inward = arrive - ENTRY_TIME["drive_back"]
    times = np.linspace(inward - TRANSFER_TIME["drive_back"], inward, 13)
    arc = [(float(time), _low(CIRCLE * direction(np.array(at)))) for time, at in zip(times, swept, strict=True)]
    return [(leave + CLEARANCE_TIME["drive_back"], _low(out)), *arc]


def _slider_track(rig: Rig, plan: Plan, motion: PushMotion) -> Track:
    """The slider rests between pushes, except while it is put elsewhere."""
    moved = plan.release + CLEARANCE_TIME[rig.retreat] + 0.02
    times, poses = [np.zeros(1)], [motion.pose[0, :1]]
    for push in range(len(plan)):
        pose = motion.pose[push].copy()
        # A reset turns the slider the short way; the tracker's unwrapped heading then stays continuous.
        turn = pose[0, 2] - poses[-1][-1, 2]
        pose[:, 2] += wrapped(turn) - turn
        times.append(plan.touch[push] + motion.time[push])
        poses.append(pose)
        if push + 1 < len(plan):
            share = 0.5 - 0.5 * np.cos(np.linspace(0, np.pi, 15))
            target = motion.pose[push + 1, 0].copy()
            target[2] = pose[-1, 2] + wrapped(target[2:] - pose[-1, 2])[0]
            times.append(moved[push] + RESET_TIME * np.linspace(0, 1, 15))
            poses.append(pose[-1] + share[:, None] * (target - pose[-1]))
    return Track(np.concatenate(times), np.concatenate(poses))


def _force_track(rig: Rig, plan: Plan, motion: PushMotion) -> Track:
    """Force (world axes, N) on the slider and torque about the tip (N m): zero without contact."""
    values = np.concatenate([motion.force, motion.torque[:, :, None]], axis=2)
    none = np.zeros((len(plan), 1, 3))
    held = values[:, -1:]
    before = (plan.touch - UNTOUCHED)[:, None]
    after = (plan.release + UNLOADING_TIME[rig.retreat])[:, None]
    time = np.concatenate([before, plan.touch[:, None] + motion.time, plan.release[:, None], after], axis=1)
    return Track(time.ravel(), np.concatenate([none, values, held, none], axis=1).reshape(-1, 3))
