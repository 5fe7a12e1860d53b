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

"""The exact effects of one push in plain numbers: the same as exact.joint, in a fraction of the time."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, isfinite
from typing import TypeAlias

import numpy as np

from push_predictor.models.effects.coefficients import Coefficients, changed_names
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import DIFFERENCE, LARGEST
from push_predictor.models.effects.scalar_effects import Columns, ScalarEffects
from push_predictor.models.mechanics.fitted import RECORDING
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.scalar.mechanics import ScalarMechanics
from push_predictor.models.mechanisms import Push
from push_predictor.types import Array

# Velocity, contact, angle, duration, heading and recording.
PushNumbers: TypeAlias = tuple[float, float, float, float, float, float]


class ScalarShift:
    """Shifts of single pushes by effects that all are exact. coefficients: theirs."""

    def __init__(self, effects: Sequence[Effect], coefficients: Coefficients, mechanics: ScalarMechanics) -> None:
        self._names, self._mechanics = changed_names(effects), mechanics
        self._effects = ScalarEffects(effects, self._names, [1.0] * len(self._names))
        self._all = range(len(effects))
        self._steps_and_limits = [(DIFFERENCE * BY_NAME[name].spread, LARGEST[name]) for name in self._names]
        self._coefficients = coefficients
        self._needs_heading = any(BY_NAME[name].needs for name in (*self._names, *mechanics.values))

    def shift(self, push: Push) -> tuple[Array, Array] | None:
        """Shift (1, 3) of the mean of one push and its covariance (1, 3, 3); None where arrays are needed.

        Raises KeyError if a covariate of a basis is missing.
        """
        velocity, contact, angle = push.inputs[0].tolist()
        given, duration = {name: float(column[0]) for name, column in push.covariates.items()}, float(push.duration[0])
        if not isfinite(velocity + contact + angle + duration + sum(given.values())):
            return None
        if self._needs_heading and "slider_heading" in given:
            _, _, normal_x, normal_y = self._mechanics.contact_at(contact)
            given["push_heading"] = given["slider_heading"] + atan2(normal_y, normal_x) + angle
        numbers = velocity, contact, angle, duration, given.get("push_heading", 0.0), given.get(RECORDING, -1.0)
        if not self._mechanics.is_plain(self._names, given):
            return None
        columns = self._effects.columns(given)
        changes = self._changes(columns)
        if not isfinite(sum(changes)):
            return None
        moved = np.array([self._moved(numbers, changes)]) - self._moved(numbers, [])
        design = self._slopes(numbers, changes)[self._coefficients.parameter] * self._effects.design(columns)
        return moved, design.T.dot(self._coefficients.covariance).dot(design)[None]

    def _changes(self, columns: Columns) -> list[float]:
        """The changes of the parameters, at most the largest that a rig can have."""
        wanted = self._effects.changes(columns, self._all)
        return [min(max(change, -most), most) for change, (_, most) in zip(wanted, self._steps_and_limits, strict=True)]

    def _slopes(self, push: PushNumbers, changes: list[float]) -> Array:
        """Derivatives (q, 3) of the displacement by each of the parameters that change; see exact.slopes_of."""
        slopes = []
        for k, (step, most) in enumerate(self._steps_and_limits):
            low, high = max(changes[k] - step, -most), min(changes[k] + step, most)
            ends = [self._moved(push, [*changes[:k], end, *changes[k + 1 :]]) for end in (low, high)]
            slopes.append([(after - before) / (high - low) for before, after in zip(*ends, strict=True)])
        return np.array(slopes)

    def _moved(self, push: PushNumbers, changes: Sequence[float]) -> tuple[float, float, float]:
        return self._mechanics.moved(*push, dict(zip(self._names, changes, strict=False)))
