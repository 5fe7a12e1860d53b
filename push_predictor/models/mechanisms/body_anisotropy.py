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

"""An underside that slides more easily along one direction of the body: runners, brushed metal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, State, no_change, response_to
from push_predictor.types import Array

STEP = 0.05


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of cos and sin part of the anisotropy in the body, (n, 3, 2)."""
    n = len(push.inputs)

    def straight(state: State, amount: float) -> Change:
        return replace(no_change(n), stretch=np.tile([amount, 0.0], (n, 1)))

    def diagonal(state: State, amount: float) -> Change:
        return replace(no_change(n), stretch=np.tile([0.0, amount], (n, 1)))

    return response_to([straight, diagonal], STEP, physics, push)


BODY_ANISOTROPY = Mechanism(
    "body_anisotropy",
    (Parameter("anisotropy along the body's x", "1", 0.8), Parameter("anisotropy along its diagonal", "1", 0.8)),
    response,
    quantities=("body_anisotropy", "body_anisotropy_diagonal"),
)
