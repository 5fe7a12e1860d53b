# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forward model: displacement(parameters, pushes), from any outline and pressure distribution.

Here pushes and parameters become arrays; the compiled kernel integrates them, one by one. It is the one place where a
push is computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.kernel.push import Slider, displacements, shifts
from push_predictor.models.mechanics.parameters import PARAMETERS, ParameterValues
from push_predictor.models.mechanics.pressure import PressureDistribution, supported_at
from push_predictor.models.mechanics.surface import (
    NO_SLOPES,
    PowerSurface,
    SurfaceTables,
    knots_about,
    power_table,
    surface_tables,
)
from push_predictor.models.pushes import Push
from push_predictor.types import Array

RECORDING = "recording"  # the covariate that numbers recordings with different supports
COLUMN = {parameter.name: k for k, parameter in enumerate(PARAMETERS)}  # of a matrix of values
TEXTBOOK = np.array([parameter.textbook for parameter in PARAMETERS])
_IN_WORLD = slice(COLUMN["grain_x"], COLUMN["gradient_y"] + 1)  # what needs the heading of a push
_STRETCHING = slice(COLUMN["body_anisotropy"], COLUMN["body_anisotropy_diagonal"] + 1)
_GRAIN = slice(COLUMN["grain_x"], COLUMN["grain_diagonal"] + 1)
_RIM = COLUMN["rim_exponent"]


class Shape(NamedTuple):
    """What the kernel needs in addition to pushes and values. in_world: whether the heading of a push matters."""

    in_world: bool
    slider: Slider


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
    _tables: dict[tuple[float, ...], SurfaceTables] = field(
        default_factory=dict, init=False, repr=False
    )  # by exponents

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
        table = np.tile(TEXTBOOK, (1 if alike else len(inputs), 1, 1))
        for name, value in values.items():
            table[:, 0, COLUMN[name]] = value
        return self.displaced(table, Push(inputs, duration, covariates or {}))[:, 0]

    def displaced(self, values: Array, push: Push, shape: Shape | None = None) -> Array:
        """The same (n, k, 3) with k rows of values in the order of parameters.PARAMETERS for each of n pushes.

        values (n, k, 28), or (1, k, 28) for all pushes. shape: `shape_of` the values, where it is known.
        """
        found = np.empty((len(push.inputs), values.shape[1], 3))
        if found.size:
            shape = shape or self.shape_of(values)
            displacements(_writeable(values), self._pushes(shape, push), shape.slider, found)
        return found

    def shifted(
        self, values: Array, shape: Shape, changes: Array, moved: Array, push: Push, *, derivatives: bool = True
    ) -> Array:
        """What changes (n, q) of q parameters shift, and its derivatives by each of them, (n, 1 + q, 3).

        values (28,); shape: theirs with the changes, see shape_of. moved (3, q): index of the parameter, step of its
        central difference, least change of it. Without derivatives (n, 1, 3).
        """
        found = np.empty((len(changes), 1 + (changes.shape[1] if derivatives else 0), 3))
        if len(changes):
            shifts(values, _writeable(changes), moved, self._pushes(shape, push), shape.slider, found)
        return found

    def shape_of(self, values: Array) -> Shape:
        """What the kernel needs for pushes with values (..., 28), tabulated if it is not yet."""
        in_world = bool(values[..., _IN_WORLD].any())
        stretched = bool(values[..., _STRETCHING].any() or (in_world and values[..., _GRAIN].any()))
        exponents = values[..., _RIM]
        knots = knots_about(float(exponents.min()), float(exponents.max())) if self.support is None else ()
        if knots not in self._tables:
            if isinstance(self.support, PowerSurface):
                self._tables[knots] = power_table(self.support)
            else:
                self._tables[knots] = surface_tables(self._known, self.outline, knots)
        tables = self._tables[knots]
        slopes = tables.slopes if stretched else NO_SLOPES
        surfaces = tables.nodes, slopes, tables.quantities, tables.power
        return Shape(in_world, Slider(self.outline.boundary, *surfaces, self.pusher_radius, self.accuracy))

    def _pushes(self, shape: Shape, push: Push) -> Array:
        """Pushes (n, 6) as the kernel takes them."""
        pushes, given = np.empty((len(push.inputs), 6)), push.covariates
        pushes[:, :3], pushes[:, 3] = push.inputs, push.duration
        pushes[:, 4] = given["push_heading"] if shape.in_world else 0.0
        pushes[:, 5] = -1.0 if self.support is None else 0.0
        if self.supports and RECORDING in given:
            for number, recording in enumerate(self.supports, len(self._known) - len(self.supports)):
                pushes[given[RECORDING] == recording, 5] = number
        return pushes

    @cached_property
    def _known(self) -> tuple[PressureDistribution, ...]:
        own = (self.support,) if isinstance(self.support, PressureDistribution) else ()
        return (*own, *self.supports.values())


def mechanics_on(
    outline: Outline,
    pusher_radius: float,
    support_points: Array | None,
    supports: Mapping[int, Array] = MappingProxyType({}),
) -> PushMechanics:
    """The mechanics on a rig's support_points (k, 3: x, y in m, load share), on a patch where these are None.

    supports: other points, by number of the recording, in place of the rig's.
    """
    own = None if support_points is None or supports else supported_at(support_points)
    return PushMechanics(outline, pusher_radius, own, {number: supported_at(k) for number, k in supports.items()})


def _writeable(values: Array) -> Array:
    """An array as the kernel takes it."""
    return values if values.flags.c_contiguous and values.flags.writeable else np.array(values, order="C")
