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

"""A limit surface that is not an ellipsoid: |f / fmax|^p + |m / mmax|^p = 1 with p other than 2.

The ellipsoid is an approximation (Howe and Cutkosky 1996); the true surface depends on the pressure distribution. A
power above 2 is fuller: under a mixed load the slider moves more in the direction of the larger part of the load.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.models.mechanisms.perturbed import Change, State, no_change, response_to
from push_predictor.types import Array

STEP = 0.1
SMALLEST_LOAD = 1e-3  # of a part of the load; a smaller part causes no motion


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of the power, (n, 3, 1)."""

    def change(state: State, amount: float) -> Change:
        """Along the normal w / v = (m / f)^(p - 1) / c, like an ellipsoid with a smaller or larger c."""
        force = np.maximum(np.hypot(state.load[:, 0], state.load[:, 1]), SMALLEST_LOAD)
        moment = np.maximum(np.abs(state.load[:, 2]), SMALLEST_LOAD)
        return replace(no_change(len(force)), spread=0.5 * amount * np.log(force / moment))

    return response_to([change], STEP, physics, push)


LIMIT_SURFACE_POWER = Mechanism(
    "limit_surface_power", (Parameter("change of the limit surface's power", "1", 3.0),), response
)
