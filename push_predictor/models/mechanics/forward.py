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

"""The forward model: displacement(parameters, pushes), from any outline and pressure distribution.

Here pushes and parameters become arrays; the compiled kernel integrates them, one by one. It is the one place where a
push is computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.kernel.push import displacements
from push_predictor.models.mechanics.parameters import PARAMETERS, ParameterValues
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.models.mechanics.surface import (
    PowerSurface,
    PushSurfaces,
    mixed_surfaces,
    patch_surfaces,
    same_surface,
)
from push_predictor.types import Array

RECORDING = "recording"  # the covariate that numbers recordings with different supports
COLUMN = {parameter.name: k for k, parameter in enumerate(PARAMETERS)}  # of a matrix of values
TEXTBOOK = np.array([parameter.textbook for parameter in PARAMETERS])
_IN_WORLD = slice(COLUMN["grain_x"], COLUMN["gradient_y"] + 1)  # what needs the heading of a push
_STRETCHING = slice(COLUMN["body_anisotropy"], COLUMN["body_anisotropy_diagonal"] + 1)
_GRAIN = slice(COLUMN["grain_x"], COLUMN["grain_diagonal"] + 1)
_RIM = COLUMN["rim_exponent"]
_NO_SLOPES = np.zeros((0, 2, 0, 16))


@dataclass(frozen=True, eq=False)
class PushMechanics:
    """Quasi-static mechanics of a slider under a disc of pusher_radius (m).

    support: of every push: a known pressure distribution, a PowerSurface as a cheap approximation of the limit surface,
    or None for a patch over the outline, whose pressure the parameter rim_exponent changes. supports: others by the
    covariate `recording`, where recordings had different supports. accuracy: of a displacement, relative.
    """

    outline: Outline
    pusher_radius: float
    support: PressureDistribution | PowerSurface | None = None
    supports: Mapping[int, PressureDistribution] = field(default_factory=dict)
    accuracy: float = 1e-3

    def displacement(
        self, values: ParameterValues, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None
    ) -> Array:
        """Displacement (n, 3: dx, dy in m, dtheta in rad) of the recorded origin in the recorded push frame.

        values: of parameters.PARAMETERS, each a number or (n,). inputs (n, 3): velocity m/s, contact, angle rad;
        duration (n,) s. Raises KeyError for a name that is no parameter, or a covariate that a parameter needs.
        """
        if unknown := set(values) - set(COLUMN):
            raise KeyError(f"{sorted(unknown)[0]!r} is no parameter of the mechanics: {', '.join(COLUMN)}")
        alike = all(np.ndim(value) == 0 for value in values.values())
        table = np.tile(TEXTBOOK, (1 if alike else len(inputs), 1))
        for name, value in values.items():
            table[:, COLUMN[name]] = value
        return self.displaced(table, inputs, duration, covariates)

    def displaced(
        self, values: Array, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None
    ) -> Array:
        """The same with values as rows (n, 28) in the order of parameters.PARAMETERS, or (1, 28) for all pushes."""
        n = len(inputs)
        found = np.empty((n, 3))
        if not n:
            return found
        given = covariates or {}
        pushes = np.empty((n, 7))
        pushes[:, :3], pushes[:, 3] = inputs, duration
        in_world = values[:, _IN_WORLD].any()
        pushes[:, 4] = given["push_heading"] if in_world else 0.0
        surfaces = self._surfaces(values, n, given)
        pushes[:, 5], pushes[:, 6], tables = surfaces.low, surfaces.share, surfaces.tables
        stretched = values[:, _STRETCHING].any() or (in_world and values[:, _GRAIN].any())
        slopes = tables.slopes if stretched else _NO_SLOPES
        displacements(
            values if values.flags.c_contiguous and values.flags.writeable else np.array(values, order="C"),
            pushes,
            self.outline.boundary,
            tables.cells,
            slopes,
            tables.quantities,
            tables.power,
            self.pusher_radius,
            self.accuracy,
            found,
        )
        return found

    def _surfaces(self, values: Array, n: int, covariates: Mapping[str, Array]) -> PushSurfaces:
        """Limit surfaces of n pushes with these values; tabulates what is not tabulated yet."""
        exponent = values[:, _RIM]
        if self.supports and RECORDING in covariates:
            known = [self.support] if isinstance(self.support, PressureDistribution) else []
            number = np.full(n, len(known) - 1)
            for recording, support in self.supports.items():
                number[covariates[RECORDING] == recording] = len(known)
                known.append(support)
            return mixed_surfaces(self.outline, np.broadcast_to(exponent, n), number, known)
        if self.support is not None:
            return self._same
        first = float(exponent[0])
        if len(exponent) == 1 or (exponent == first).all():
            if first not in self._of_exponent:
                self._of_exponent[first] = patch_surfaces(self.outline, exponent[:1])
            return self._of_exponent[first]
        return patch_surfaces(self.outline, exponent)

    @cached_property
    def _same(self) -> PushSurfaces:
        assert self.support is not None
        return same_surface(self.support)

    @cached_property
    def _of_exponent(self) -> dict[float, PushSurfaces]:
        return {}
