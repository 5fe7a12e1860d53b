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

"""What effects change at one push, in plain numbers: arrays of one row take several times as long."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from push_predictor.models.effects.driver_basis import columns_of
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import quantities_of
from push_predictor.types import Array

Columns = list[list[float]]  # of each effect: the values of its basis at one push


class ScalarEffects:
    """Some effects at single pushes. names (q): of the parameters that they change; units (q,): of these changes."""

    def __init__(self, effects: Sequence[Effect], names: Sequence[str], units: Sequence[float]) -> None:
        self._bases = [effect.basis for effect in effects]
        self._none = [0.0] * len(names)
        self._counts, self._rows = [], []
        for effect, basis in zip(effects, self._bases, strict=True):
            width = columns_of(basis)
            self._counts.append(len(effect.coefficients) // width)
            rows = effect.coefficients.reshape(-1, width).tolist()
            changed = [names.index(name) for name in (quantities_of(effect) if effect.exact else ())]
            self._rows.append([(k, [c / units[k] for c in row]) for k, row in zip(changed, rows, strict=False)])

    def columns(self, covariates: Mapping[str, float]) -> Columns:
        """The values of the bases. Raises KeyError if a covariate is missing."""
        return [basis.values_one(covariates) for basis in self._bases]

    def design(self, columns: Columns) -> Array:
        """The basis values (m, 1) that go with all coefficients."""
        values = [value for own, count in zip(columns, self._counts, strict=True) for value in own * count]
        return np.array(values)[:, None]

    def changes(self, columns: Columns, chosen: Sequence[int]) -> list[float]:
        """The changes (q) of the parameters by the effects of these numbers, in the units."""
        changes = self._none.copy()
        for effect in chosen:
            own = columns[effect]
            for k, row in self._rows[effect]:
                changes[k] += row[0] * own[0] if len(row) == 1 else sum(c * x for c, x in zip(row, own, strict=True))
        return changes
