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

"""Fitted mechanics in plain numbers: for a single push some twenty times as fast as arrays of one row.

The same mathematics as in forward, step by step, so that a push gets the same answer alone as among others, to the
tolerance of the contact. Many pushes, and pushes with inertia, are computed as arrays.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite

import numpy as np

from push_predictor.geometry.nearest import ContactAt, Nearest, contact_on, nearest_on
from push_predictor.models.mechanics.fitted import NO_CHANGES, RECORDING, FittedMechanics
from push_predictor.models.mechanics.parameters import BY_NAME, RowValues
from push_predictor.models.mechanics.scalar.push import ScalarPush
from push_predictor.models.mechanics.scalar.surface import ScalarSurface, Three, scalar_surface
from push_predictor.models.mechanics.scalar.values import ScalarValues, scalar_values
from push_predictor.types import Array

MOST_SURFACES = 64  # that are kept prepared
FEW = 200  # pushes: as fast as an array of them


@dataclass(frozen=True, eq=False)
class ScalarMechanics(FittedMechanics):
    """FittedMechanics that computes few pushes in plain numbers. Made by `scalar_mechanics`."""

    nearest: Nearest = field(kw_only=True)
    contact_at: ContactAt = field(kw_only=True)
    _surfaces: dict[object, ScalarSurface] = field(default_factory=dict, kw_only=True)

    def displacement(
        self,
        inputs: Array,
        duration: Array,
        covariates: Mapping[str, Array] | None = None,
        changes: Mapping[str, Array] = NO_CHANGES,
    ) -> Array:
        """See FittedMechanics."""
        if not 0 < len(inputs) <= FEW:
            return super().displacement(inputs, duration, covariates, changes)
        given = covariates or {}
        pushes: list[tuple[float, float, float, float]] = [
            (*row, seconds) for row, seconds in zip(inputs.tolist(), duration.tolist(), strict=True)
        ]
        columns = {name: column.tolist() for name, column in changes.items()}
        plain = all(isfinite(sum(numbers)) for numbers in (*pushes, *columns.values()))
        if not plain or not self.is_plain(tuple(changes), given):
            return super().displacement(inputs, duration, covariates, changes)
        heading = given["push_heading"].tolist() if "push_heading" in given else [0.0] * len(pushes)
        recording = given[RECORDING].tolist() if RECORDING in given else [-1] * len(pushes)
        moved = [
            self.moved(*numbers, heading[k], recording[k], {name: column[k] for name, column in columns.items()})
            for k, numbers in enumerate(pushes)
        ]
        return np.array(moved)

    def is_plain(self, changed: Sequence[str], given: Container[str]) -> bool:
        """Whether pushes with these changed parameters and these covariates are computed in plain numbers."""
        if "inertia" in changed or self.value("inertia"):
            return False
        needs = [need for name in changed for need in BY_NAME[name].needs]
        return all(name in given for name in (*self.needs, *needs))

    def moved(
        self,
        velocity: float,
        contact: float,
        angle: float,
        duration: float,
        heading: float = 0.0,
        recording: float = -1,
        changes: Mapping[str, float] | None = None,
    ) -> Three:
        """Displacement of one push, without checks.

        heading: of the push in the world, where a parameter needs it. changes: what is added to values of parameters.
        """
        if not changes:
            values, known = self.values, self._known
        else:
            values = {**self.values, **{name: self.value(name) + change for name, change in changes.items()}}
            known = scalar_values(values)
        surface = self._surface(recording, values)
        return ScalarPush(self, known, surface, velocity, contact, angle, duration, heading).displacement()

    @cached_property
    def _known(self) -> ScalarValues:
        return scalar_values(self.values)

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """See FittedMechanics."""
        return super().needs

    def _surface(self, recording: float, values: Mapping[str, float]) -> ScalarSurface:
        key = recording, values.get("rim_exponent"), values.get("pressure_spread")
        if key not in self._surfaces:
            if len(self._surfaces) >= MOST_SURFACES:
                self._surfaces.clear()
            rows = RowValues(values, 1, {RECORDING: np.array([recording])})
            self._surfaces[key] = scalar_surface(self.mechanics.surfaces(rows))
        return self._surfaces[key]


def scalar_mechanics(fitted: FittedMechanics) -> ScalarMechanics:
    """The same mechanics, prepared for single pushes."""
    outline = fitted.mechanics.outline
    return ScalarMechanics(
        fitted.mechanics,
        fitted.values,
        fitted.covariance,
        nearest=nearest_on(outline),
        contact_at=contact_on(outline),
    )
