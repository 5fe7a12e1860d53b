# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What an engine returns: the slider's motion and the contact's force during each push."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.plan import Plan
from benchmarks.foreign.rig import PUSHER_RADIUS, Rig
from benchmarks.support.plane import Array, IntArray, cross, direction, rotate


@dataclass(frozen=True)
class PushMotion:
    """Pushes at equally spaced instants from first touch to the end of travel, shape (pushes, instants, ...).

    `time` s since touch; `pose` m, m, rad in the world; `force` N of the tip on the slider, world axes; `torque`
    N m of that force about the tip's centre; `touch` and `heading` are the robot's position at touch (m) and
    the push direction (rad).
    """

    time: Array
    pose: Array
    force: Array
    torque: Array
    touch: Array
    heading: Array

    def rows(self, rows: IntArray) -> PushMotion:
        """The motion of some pushes."""
        return PushMotion(**{name: values[rows] for name, values in vars(self).items()})


def empty_motion(plan: Plan, steps: int) -> PushMotion:
    """Motion of the pushes of a plan in `steps` steps, still to be filled in."""
    count = len(plan)
    return PushMotion(
        time=(plan.travel / plan.speed)[:, None] * np.linspace(0, 1, steps + 1),
        pose=np.zeros((count, steps + 1, 3)),
        force=np.zeros((count, steps + 1, 2)),
        torque=np.zeros((count, steps + 1)),
        touch=np.zeros((count, 2)),
        heading=np.zeros(count),
    )


@dataclass(frozen=True)
class Line:
    """Straight lines of the robot: position at first touch (m, world) and direction (rad)."""

    touch: Array
    heading: Array

    def at(self, travelled: Array) -> Array:
        """Robot positions `travelled` m after first touch."""
        return np.asarray(self.touch + travelled[:, None] * direction(self.heading))


def push_lines(rig: Rig, plan: Plan, rows: IntArray, start: Array) -> Line:
    """Lines of the pushes `rows`, whose slider starts at the poses `start` (world)."""
    point, outward = rig.outline.boundary(plan.contact[rows])
    inward_angle = np.arctan2(-outward[:, 1], -outward[:, 0])
    tip = point + PUSHER_RADIUS * outward
    return Line(start[:, :2] + rotate(tip, start[:, 2]), start[:, 2] + inward_angle + plan.angle[rows])


def torque_about_tip(point: Array, tip: Array, force: Array) -> Array:
    """Torque of a force about the tip's centre, N m."""
    return cross(point - tip, force)


def start_waves(stays: IntArray) -> list[IntArray]:
    """Groups of pushes such that each push starts where a push of an earlier group left the slider."""
    depth = np.zeros(len(stays), int)
    for row in range(1, len(stays)):
        depth[row] = depth[row - 1] + 1 if stays[row] else 0
    return [np.flatnonzero(depth == level) for level in range(int(depth.max()) + 1)]
