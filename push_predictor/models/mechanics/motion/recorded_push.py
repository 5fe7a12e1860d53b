# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The kinematics of the measurement: from a push as it was recorded to the push as it was, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.parameters import RowValues
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class TruePush:
    """n pushes as they were, in the frame of the slider's first pose.

    tip (n, 2) m: centre of the disc at the start. radius (n,) m of the disc. ahead (n, 2): direction of its path.
    travel (n,) m, speed (n,) m/s. recorded (n, 2): direction of the path as it was recorded. origin (n, 2) m: of the
    recorded body frame.
    """

    tip: Array
    radius: Array
    ahead: Array
    travel: Array
    speed: Array
    recorded: Array
    origin: Array

    @property
    def recorded_angle(self) -> Array:
        """Angle (n,) rad of the recorded direction in the slider's true frame."""
        return np.asarray(np.arctan2(self.recorded[:, 1], self.recorded[:, 0]))

    def recorded_displacement(self, pose: Array) -> Array:
        """Displacement (n, 3) of the recorded origin in the recorded push frame, of the true pose (n, 3)."""
        moved = pose[:, :2] + rotate(self.origin, pose[:, 2]) - self.origin
        return np.column_stack([rotate(moved, -self.recorded_angle), pose[:, 2]])


def true_push(outline: Outline, rig_radius: float, values: RowValues, inputs: Array, duration: Array) -> TruePush:
    """The pushes that were recorded with these inputs (n, 3) and duration (n,) on a rig with that pusher radius (m)."""
    velocity, contact, angle = np.asarray(inputs, dtype=np.float64).T
    normal = outline.inward_normal(contact)
    recorded = rotate(normal, angle)
    across = np.column_stack([-recorded[:, 1], recorded[:, 0]])
    along = values.of("tip_offset_along") + velocity * values.of("clock_delay")
    tip = outline.point(contact) - rig_radius * normal
    tip = tip + along[:, None] * recorded + values.of("tip_offset_across")[:, None] * across
    shift, turned = values.pair("outline_x", "outline_y"), values.of("tracker_rotation")
    direction, speed = rotate(recorded, -turned), velocity * (1.0 + values.of("travel_share"))
    radius, tip = rig_radius + values.of("radius_error"), rotate(tip - shift, -turned)
    return TruePush(
        _in_contact(outline, values, tip, radius),
        radius,
        rotate(direction, values.of("push_rotation")),
        speed * duration,
        speed,
        direction,
        rotate(-shift, -turned),
    )


def _in_contact(outline: Outline, values: RowValues, tip: Array, radius: Array) -> Array:
    """The tips, moved along the outline's normal until they touch: a window begins in contact."""
    moved = ("outline_x", "outline_y", "tracker_rotation", "radius_error")
    if not values.active("tip_offset_along", "tip_offset_across", "clock_delay", *moved):
        return tip
    nearest = outline.project(tip)
    return np.asarray(nearest.point + nearest.normal * radius[:, None])
