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

"""A contact with more friction in one direction than in the other: machining marks, a tip that leans or is turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, State, no_change, response_to
from push_predictor.types import Array

STEP = 0.05


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit by which the friction is larger in slip to the left and smaller to the right, (n, 3, 1)."""

    def change(state: State, amount: float) -> Change:
        return replace(no_change(len(state.turn)), friction=amount * state.slip.astype(np.float64))

    return response_to([change], STEP, physics, push)


CONTACT_ASYMMETRY = Mechanism(
    "contact_asymmetry",
    (Parameter("contact friction in slip to the left less the mean", "1", 1.0),),
    response,
    quantities=("friction_difference",),
)
