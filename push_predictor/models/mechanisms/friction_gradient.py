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

"""A table with more friction on one side of the slider than on the other: it shifts the centre of friction there.

With friction that rises by the fraction s per metre along a direction, the centre of friction moves along it by s times
the mean square of the pressure's distance from the centre in that direction. For a disc of uniform pressure that is
9 / 16 of c^2; for a square it is the same within 1 %.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, ChangeOf, State, no_change, response_to
from push_predictor.types import Array

STEP = 2.0  # 1 / m
SQUARE_OF_SPREAD = 9.0 / 16.0  # mean square along one direction, in units of c^2


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of the gradient along the world's x and y, (n, 3, 2)."""
    heading = push.covariates["slider_heading"]
    square = SQUARE_OF_SPREAD * physics.support.length**2

    def along(direction: tuple[float, float]) -> ChangeOf:
        def change(state: State, amount: float) -> Change:
            in_world = np.tile(amount * square * np.array(direction), (len(heading), 1))
            return replace(no_change(len(heading)), centre=rotate(in_world, -(heading + state.turn)))

        return change

    return response_to([along((1.0, 0.0)), along((0.0, 1.0))], STEP, physics, push)


FRICTION_GRADIENT = Mechanism(
    "friction_gradient",
    (
        Parameter("relative rise of friction along the world's x", "1/m", 50.0),
        Parameter("the same along y", "1/m", 50.0),
    ),
    response,
    needs=("slider_heading",),
    quantities=("gradient_x", "gradient_y"),
)
