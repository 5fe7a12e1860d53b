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

"""A surface that is easier to slide on along one direction of the world: grain, brushing, weave.

Ma and Rodriguez 2018 found it in the MIT set; its period over the heading is pi.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, ChangeOf, State, no_change, response_to
from push_predictor.types import Array

STEP = 0.05


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of cos and sin part of the anisotropy in the world, (n, 3, 2)."""
    heading = push.covariates["slider_heading"]

    def along(direction: tuple[float, float]) -> ChangeOf:
        def change(state: State, amount: float) -> Change:
            in_world = np.tile(amount * np.array(direction), (len(heading), 1))
            return replace(no_change(len(heading)), stretch=rotate(in_world, -2.0 * (heading + state.turn)))

        return change

    return response_to([along((1.0, 0.0)), along((0.0, 1.0))], STEP, physics, push)


ANISOTROPIC_FRICTION = Mechanism(
    "anisotropic_friction",
    (Parameter("anisotropy along the world's x", "1", 0.8), Parameter("anisotropy along the diagonal", "1", 0.8)),
    response,
    needs=("slider_heading",),
    quantities=("grain_x", "grain_diagonal"),
)
