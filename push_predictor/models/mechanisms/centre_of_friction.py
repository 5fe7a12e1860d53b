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

"""The centre of friction away from where the base model assumes it: an uneven load, a part that has shifted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.types import Array

STEP = 0.002  # m


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per metre along the body's x and y, (n, 3, 2)."""

    def displaced(x: float, y: float) -> AnalyticalPush:
        centre = (physics.support.centre[0] + x, physics.support.centre[1] + y)
        return replace(physics, support=replace(physics.support, centre=centre))

    ends = [displaced(sign * x, sign * y) for x, y in ((STEP, 0.0), (0.0, STEP)) for sign in (1.0, -1.0)]
    moved = physics.displacements(ends, push.inputs, push.duration)
    return np.moveaxis(moved[0::2] - moved[1::2], 0, 2) / (2.0 * STEP)


CENTRE_OF_FRICTION = Mechanism(
    "centre_of_friction",
    (Parameter("shift along the body's x", "m", 0.05), Parameter("shift along the body's y", "m", 0.05)),
    response,
    quantities=("centre_x", "centre_y"),
)
