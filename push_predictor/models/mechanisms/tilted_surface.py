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

"""A table that is not level, or another steady pull on the slider: it adds to the load on the limit surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, ChangeOf, State, no_change, response_to
from push_predictor.types import Array

STEP = 0.02


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of the pull along the world's x and y, as fractions of the sliding friction, (n, 3, 2)."""
    heading = push.covariates["slider_heading"]
    n = len(heading)

    def along(direction: tuple[float, float]) -> ChangeOf:
        def change(state: State, amount: float) -> Change:
            pull = rotate(np.tile(amount * np.array(direction), (n, 1)), -(heading + state.turn))
            return replace(no_change(n), pull=np.column_stack([pull, np.zeros(n)]))

        return change

    return response_to([along((1.0, 0.0)), along((0.0, 1.0))], STEP, physics, push)


TILTED_SURFACE = Mechanism(
    "tilted_surface",
    (Parameter("pull along the world's x, share of friction", "1", 0.7), Parameter("the same along y", "1", 0.7)),
    response,
    needs=("slider_heading",),
    quantities=("slope_x", "slope_y"),
)
