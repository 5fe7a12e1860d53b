# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Contact between a compliant round tip and the slider's outline, with Coulomb friction.

The tip sits on an isotropic spring whose other end the robot moves. The tip itself has no mass: it sticks to a point
of the outline as long as the spring's force lies in the friction cone, and otherwise slides along the outline until
the force lies on the cone's edge. Everything here is in the slider's body axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.outlines import Outline
from benchmarks.foreign.rig import PUSHER_RADIUS
from benchmarks.support.plane import Array, BoolArray, cross, quarter_turn


@dataclass(frozen=True)
class TipContact:
    """Contact of a batch: the tip's centre, whether it touches, force on the slider (N), and the point where it acts.

    `deflection` is the spring's compression along the normal, m. `stiffness` (pushes, 2, 2) is the derivative of the
    force by the robot's position, N/m.
    """

    tip: Array
    touching: BoolArray
    force: Array
    point: Array
    deflection: Array
    stiffness: Array


@dataclass(frozen=True)
class TipMounting:
    """How the tip is held and what it rubs on: spring (N/m), friction, and normal_tilt of the outline's normal (rad).

    `damping` is the spring's relaxation time over the length of the step: the normal force resists compression too.
    """

    stiffness: Array
    damping: Array
    tip_friction: Array
    normal_tilt: Array


def free(count: int) -> TipContact:
    """No contact, for `count` pushes."""
    zeros = np.zeros((count, 2))
    return TipContact(zeros, np.zeros(count, bool), zeros, zeros, np.zeros(count), np.zeros((count, 2, 2)))


def resolve(outline: Outline, before: TipContact, robot: Array, mounting: TipMounting) -> TipContact:
    """Contact after the robot's end of the spring moved to `robot` (pushes, 2), given the contact before."""
    foot, outward, distance = outline.closest(robot)
    inside = distance < PUSHER_RADIUS
    start = np.where(before.touching[:, None], before.tip, foot + PUSHER_RADIUS * outward)
    # Compression against the old normal: sliding around a corner must not feed back into the damping.
    compression = np.sum((robot - start) * _inward(outline, start, mounting), axis=1) - before.deflection
    damped = mounting.damping * compression
    tip, inward, sliding, side = _slide(outline, start, robot, damped, mounting)
    along = quarter_turn(inward)
    deflection = np.sum((robot - tip) * inward, axis=1)
    normal = mounting.stiffness * (deflection + damped)
    tangential = mounting.stiffness * np.sum((robot - tip) * along, axis=1)
    tangential = np.clip(
        tangential, -mounting.tip_friction * np.maximum(normal, 0), mounting.tip_friction * np.maximum(normal, 0)
    )
    touching = np.asarray((before.touching | inside) & (normal > 0))
    force = np.where(touching[:, None], normal[:, None] * inward + tangential[:, None] * along, 0.0)
    # A sliding tip pushes along the cone's edge, a sticking one against any displacement.
    press = inward + np.where(sliding, mounting.tip_friction * side, 0.0)[:, None] * along
    yielding = ((1 + mounting.damping)[:, None] * press)[:, :, None] * inward[:, None, :]
    yielding = yielding + np.where(sliding, 0.0, 1.0)[:, None, None] * along[:, :, None] * along[:, None, :]
    derivative = np.where(touching[:, None, None], mounting.stiffness[:, None, None] * yielding, 0.0)
    foot = outline.closest(tip)[0]
    # A spring that lost contact while compressed must not meet the outline as if at high speed in the next step.
    deflection = np.where(touching, deflection, np.maximum(PUSHER_RADIUS - distance, 0.0))
    return TipContact(tip, touching, force, foot, deflection, derivative)


def _slide(
    outline: Outline, start: Array, robot: Array, damped: Array, mounting: TipMounting
) -> tuple[Array, Array, BoolArray, Array]:
    """Tip centre, inward normal, whether it slides, and the side to which friction acts, after two corrections."""
    tip = start
    inward = _inward(outline, tip, mounting)
    sliding = np.zeros(len(tip), bool)
    side = np.zeros(len(tip))
    for _ in range(2):
        along = quarter_turn(inward)
        normal = np.sum((robot - tip) * inward, axis=1) + damped
        tangential = np.sum((robot - tip) * along, axis=1)
        excess = np.abs(tangential) - mounting.tip_friction * np.maximum(normal, 0.0)
        sliding = sliding | (excess > 0)
        side = np.where(excess > 0, np.sign(tangential), side)
        moved = tip + np.where(sliding, side * excess, 0.0)[:, None] * along
        foot, outward, _ = outline.closest(moved)
        tip = np.where(sliding[:, None], foot + PUSHER_RADIUS * outward, tip)
        inward = np.where(sliding[:, None], _tilted(-outward, mounting.normal_tilt), inward)
    return tip, inward, sliding, side


def _inward(outline: Outline, tip: Array, mounting: TipMounting) -> Array:
    return _tilted(-outline.closest(tip)[1], mounting.normal_tilt)


def _tilted(inward: Array, normal_tilt: Array) -> Array:
    if not np.any(normal_tilt):
        return inward
    return np.asarray(np.cos(normal_tilt)[:, None] * inward + np.sin(normal_tilt)[:, None] * quarter_turn(inward))


def wrench(contact: TipContact) -> Array:
    """Force and torque of the tip on the slider about its centre, shape (pushes, 3), body axes."""
    return np.column_stack([contact.force, cross(contact.point, contact.force)])
