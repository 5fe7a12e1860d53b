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

"""How far from the centre the pressure acts: the limit surface's length c = mmax / fmax (Goyal et al. 1991)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.types import Array

STEP = 0.05  # of the logarithm


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of the logarithm of c, (n, 3, 1)."""
    supports = (replace(physics.support, length=physics.support.length * float(np.exp(s))) for s in (STEP, -STEP))
    ends = [replace(physics, support=support) for support in supports]
    more, less = physics.displacements(ends, push.inputs, push.duration)
    return np.asarray(((more - less) / (2.0 * STEP))[:, :, None])


PRESSURE_SPREAD = Mechanism(
    "pressure_spread",
    (Parameter("logarithm of the factor on the pressure's spread", "1", 1.0),),
    response,
    quantities=("pressure_spread",),
)
