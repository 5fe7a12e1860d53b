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

"""A push above the table presses the slider's front down: the centre of friction moves forward.

Balance of moments about the table: a force f at height h shifts the normal load by h f / (m g), which is h times the
surface friction where the force is the full sliding friction (Mason 1986, Lynch and Mason 1996 assume h = 0).
"""

from __future__ import annotations

from dataclasses import replace

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, State, no_change, response_to
from push_predictor.types import Array

STEP = 0.001  # m


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per metre of height times surface friction, (n, 3, 1)."""

    def change(state: State, amount: float) -> Change:
        return replace(no_change(len(state.turn)), centre=amount * state.load[:, :2])

    return response_to([change], STEP, physics, push)


PUSHING_HEIGHT = Mechanism(
    "pushing_height",
    (Parameter("height of the push times surface friction", "m", 0.05),),
    response,
    quantities=("pushing_height",),
)
