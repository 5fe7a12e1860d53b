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

"""Physics without noise: uniform friction of the table, constant load and contact friction."""

from __future__ import annotations

import numpy as np

from push_predictor.simulation.noise import PushNoise
from push_predictor.simulation.surface import CELL, HALF_EXTENT, FrictionField


def uniform_field(friction: float) -> FrictionField:
    """The same friction everywhere on the table."""
    size = round(2.0 * HALF_EXTENT / CELL) + 1
    return FrictionField(np.full((size, size), friction))


def no_noise(n: int, k: int) -> PushNoise:
    """Deviations of n pushes that are zero, k wide."""
    return PushNoise(np.zeros((n, k)), np.zeros((n, 2, k)))
