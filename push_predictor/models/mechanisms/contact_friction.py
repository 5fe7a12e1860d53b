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

"""Friction between pusher and slider that differs from the base model's (Coulomb; Mason 1986)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.types import Array

STEP = 0.1  # large enough to include pushes that are about to slip


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of the coefficient, (n, 3, 1): zero where the contact sticks."""
    low = max(physics.contact_friction - STEP, 0.0)
    high = physics.contact_friction + STEP
    ends = [replace(physics, contact_friction=mu) for mu in (high, low)]
    more, less = physics.displacements(ends, push.inputs, push.duration)
    return np.asarray(((more - less) / (high - low))[:, :, None])


CONTACT_FRICTION = Mechanism(
    "contact_friction",
    (Parameter("change of the contact friction", "1", 1.0),),
    response,
    quantities=("contact_friction",),
)
