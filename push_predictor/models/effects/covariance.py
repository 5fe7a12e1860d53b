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

"""The covariance of all coefficients of a model's effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.types import Array


def covariance_of(effects: Sequence[Effect], cross: Mapping[tuple[int, int], Array]) -> Array:
    """Covariance (m, m) of the coefficients of all effects, in their order; cross: see Predictor."""
    starts = np.cumsum([0, *(len(effect.coefficients) for effect in effects)])
    parts = [slice(*ends) for ends in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)]
    covariance = np.zeros((starts[-1], starts[-1]))
    for part, effect in zip(parts, effects, strict=True):
        covariance[part, part] = effect.covariance
    for (i, j), shared in cross.items():
        covariance[parts[i], parts[j]], covariance[parts[j], parts[i]] = shared, shared.T
    return covariance
