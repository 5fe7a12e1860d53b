# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The gaps between a corrected outline and the tip, and their derivatives by the correction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, to_world
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.geometry.shapes import stretched
from push_predictor.types import Array, BoolArray, IntArray

YAW, X, Y, SIZE, LAG, TIP, FRAME_YAW, FRAME_X, FRAME_Y, STRETCH = range(10)
SMALLEST = -0.9  # relative correction of the size: a smaller slider is none


@dataclass(frozen=True, eq=False)
class Contacts:
    """n samples in contact.

    tips (n, 2) m and velocities (n, 2) m/s of the tip in the slider's frame; push (n,): number of the push; poses
    (n, 3) of the slider in the world frame: x, y (m) and heading (rad).
    """

    tips: Array
    velocities: Array
    push: IntArray
    poses: Array

    def at(self, rows: IntArray | BoolArray) -> Contacts:
        """The chosen samples: indices, or a mask (n,)."""
        return Contacts(self.tips[rows], self.velocities[rows], self.push[rows], self.poses[rows])


class Touches:
    """Contacts, and their gaps to a corrected outline whose centroid is the origin, m.

    radius: of the tip, m. middle (2,): the centroid in the slider's frame, m.
    """

    def __init__(self, contacts: Contacts, outline: Outline, radius: float, middle: Array) -> None:
        self.push, self.outline, self.radius = contacts.push, outline, radius
        self._contacts, self._middle = contacts, middle
        self._world = to_world(contacts.tips, contacts.poses)
        self.centre = np.asarray(self._world.mean(axis=0))
        self._last: tuple[bytes, Placed] | None = None

    def placed(self, correction: Array) -> Placed:
        """The tips against the corrected outline; correction (10,) as in OutlineFit. The last one is kept."""
        key = correction.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, self._placed(correction)
        return self._last[1]

    def gaps(self, correction: Array) -> Array:
        """Gaps (n,) m between tip and outline, negative inside."""
        placed = self.placed(correction)
        return np.asarray(placed.size * placed.nearest.distance - correction[TIP] - self.radius)

    def slopes(self, correction: Array) -> Array:
        """Derivatives (n, 10) of the gaps by the correction.

        A distance grows along the outward normal; by a change of the outline it falls by what its nearest point moves
        along the normal.
        """
        placed, contacts = self.placed(correction), self._contacts
        nearest, own, size = placed.nearest, placed.own, placed.size
        normal = rotate(nearest.normal, correction[YAW])  # in the slider's frame
        in_world = rotate(normal, contacts.poses[:, 2])
        away = self._world - self.centre
        slopes = np.empty((len(own), len(correction)))
        slopes[:, YAW] = size * _cross(nearest.normal, own)
        slopes[:, [X, Y]] = -normal
        slopes[:, SIZE] = nearest.distance - _dot(nearest.normal, own) if correction[SIZE] > SMALLEST else 0.0
        slopes[:, LAG] = -_dot(normal, contacts.velocities)
        slopes[:, TIP] = -1.0
        slopes[:, FRAME_YAW] = -_cross(in_world, rotate(away, correction[FRAME_YAW]))
        slopes[:, [FRAME_X, FRAME_Y]] = in_world
        slopes[:, STRETCH] = -size * _dot(nearest.normal, self._moved(nearest.point, float(correction[STRETCH])))
        return slopes

    def _placed(self, correction: Array) -> Placed:
        yaw, x, y, growth, lag, _, *frame, stretch = correction.tolist()
        size = 1.0 + max(growth, SMALLEST)
        tips = self._tips(*frame) - self._middle - lag * self._contacts.velocities - [x, y]
        own = rotate(tips, np.array(-yaw)) / size
        return Placed(own, size, stretched(self.outline, stretch).project(own))

    def _tips(self, yaw: float, x: float, y: float) -> Array:
        """The tips in the slider's frame, after a turn about the centre and a shift in the world frame."""
        if yaw == x == y == 0.0:
            return self._contacts.tips
        turned = self.centre + rotate(self._world - self.centre, np.array(yaw)) + [x, y]
        return to_body(turned, self._contacts.poses)

    def _moved(self, points: Array, stretch: float) -> Array:
        """Change of points (n, 2) of the stretched outline with the stretch; see shapes.stretched."""
        turn = np.array(0.0 if self.outline.semi_axes is None else self.outline.pose[2])
        share = np.array([0.5 / (1.0 + 0.5 * stretch), -0.5 / (1.0 - 0.5 * stretch)])
        return rotate(share * rotate(points, -turn), turn)


@dataclass(frozen=True, eq=False)
class Placed:
    """Tips own (n, 2) m in the frame of the outline as given, which is `size` times as large, and their projection."""

    own: Array
    size: float
    nearest: Projection


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(one[:, 0] * other[:, 0] + one[:, 1] * other[:, 1])


def _cross(one: Array, other: Array) -> Array:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
