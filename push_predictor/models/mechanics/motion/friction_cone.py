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

"""The law of contact friction: the edges of the friction cone, from few numbers."""

from __future__ import annotations

import numpy as np

from push_predictor.models.mechanics.motion.contact_solution import Touch
from push_predictor.models.mechanics.parameters import RowValues
from push_predictor.types import Array, IntArray

REFERENCE_SPEED = 0.02  # m/s, at which friction_by_speed is zero
SLOWEST = 1e-4  # m/s, of a tangential speed


def friction_cone(values: RowValues, rows: IntArray, touch: Touch, speed: Array, gauge: Array) -> tuple[Array, Array]:
    """Angles of the cone's edges to the left and to the right of the normal (k,), rad.

    speed (k,) m/s of the pusher. gauge (k,): of the load under a unit force along the normal; the normal force is the
    inverse of it.
    """
    friction = values.of("contact_friction")[rows]
    if values.active("friction_by_angle"):
        friction = friction + values.of("friction_by_angle")[rows] * np.abs(np.arctan2(touch.across, touch.along))
    if values.active("friction_by_speed"):
        tangential = np.maximum(speed * np.abs(touch.across), SLOWEST)
        friction = friction + values.of("friction_by_speed")[rows] * np.log(tangential / REFERENCE_SPEED)
    if values.active("friction_by_load"):
        friction = friction - values.of("friction_by_load")[rows] * np.log(gauge)
    if not values.active("friction_difference"):
        edge = np.arctan(np.maximum(friction, 0.0))
        return edge, edge
    difference = values.of("friction_difference")[rows]
    return np.arctan(np.maximum(friction + difference, 0.0)), np.arctan(np.maximum(friction - difference, 0.0))
