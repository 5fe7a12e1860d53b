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

"""Mass: at speed the slider resists a change of its motion, which the quasi-static model neglects.

D'Alembert: a mass that accelerates by a bears the load -m a, in units of the sliding friction -a / (mu g); it grows
with the square of the speed. The mass is assumed to be distributed as the pressure is. The first instants after the
touch, when the slider starts from rest, are not included.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.friction_gradient import SQUARE_OF_SPREAD
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, State, no_change, response_to
from push_predictor.types import Array

STEP = 0.02  # s^2 / m


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of 1 / (mu g), (n, 3, 1)."""
    square = push.inputs[:, 0] ** 2
    turning = 2.0 * SQUARE_OF_SPREAD * physics.support.length  # inertia over mass and c

    def change(state: State, amount: float) -> Change:
        force = rotate(state.bend[:, :2], -state.turn)
        pull = np.column_stack([force, turning * state.bend[:, 2]])
        return replace(no_change(len(square)), pull=-amount * square[:, None] * pull)

    return response_to([change], STEP, physics, push)


INERTIA = Mechanism(
    "inertia",
    (Parameter("inverse of surface friction times gravity", "s^2/m", 3.0),),
    response,
    quantities=("inertia",),
)
