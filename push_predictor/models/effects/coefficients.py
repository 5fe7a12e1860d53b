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

"""All coefficients of a model's effects in one vector, with what each of them acts on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.models.effects.driver_basis import columns_of
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import quantities_of
from push_predictor.types import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Coefficients:
    """All coefficients (m,) of some effects, with their covariance (m, m), in the order of the effects.

    parameter (m,): the parameter that each acts on: those that change, see changed_names, then those of each linear
    effect. linear (m,): whether the shift is linear in it.
    """

    values: Array
    covariance: Array
    parameter: IntArray
    linear: BoolArray


def changed_names(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Names of the parameters of the mechanics that exact effects change, each once."""
    return tuple(dict.fromkeys(name for effect in effects if effect.exact for name in quantities_of(effect)))


def coefficients_of(effects: Sequence[Effect], cross: Mapping[tuple[int, int], Array]) -> Coefficients:
    """The coefficients of one or more effects; cross: see Predictor."""
    names, starts = changed_names(effects), np.cumsum([0, *(len(effect.coefficients) for effect in effects)])
    parts = [slice(*ends) for ends in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True)]
    covariance = np.zeros((starts[-1], starts[-1]))
    for part, effect in zip(parts, effects, strict=True):
        covariance[part, part] = effect.covariance
    for (i, j), shared in cross.items():
        covariance[parts[i], parts[j]], covariance[parts[j], parts[i]] = shared, shared.T
    parameter, used = [], len(names)
    for effect in effects:
        columns = columns_of(effect.basis)
        count = len(effect.coefficients) // columns
        own = [names.index(name) for name in quantities_of(effect)] if effect.exact else range(used, used + count)
        used += 0 if effect.exact else count
        parameter.append(np.repeat(own, columns))
    linear = np.concatenate([np.full(len(effect.coefficients), not effect.exact) for effect in effects])
    values = np.concatenate([effect.coefficients for effect in effects])
    return Coefficients(values, covariance, np.concatenate(parameter), linear)
