# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forward model with values for its parameters: what a model uses and a model file keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.forward import COLUMN, RECORDING, TEXTBOOK, PushMechanics, Shape
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.pressure import PressureDistribution, patch
from push_predictor.models.mechanics.surface import PowerSurface, uniform_ellipsoid
from push_predictor.models.pushes import Push
from push_predictor.types import Array

# Of a parameter's prior standard deviation: a shorter step of a derivative would show errors of the integration.
DIFFERENCE = 0.5
TEXTBOOK_FRICTION = 0.3
ANALYTICAL_ACCURACY = 1e-4  # of a displacement, relative


class _Changed(NamedTuple):
    """What is the same for all changes of some parameters; moved: see PushMechanics.shifted."""

    shape: Shape
    moved: Array
    heading: bool


@dataclass(frozen=True, eq=False)
class FittedMechanics:
    """Mechanics with the values of its free parameters; the others have their textbook values.

    covariance (p, p): of the values, in their order; zero where nothing was fitted.
    """

    mechanics: PushMechanics
    values: dict[str, float] = field(default_factory=dict)
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    _changed: dict[tuple[tuple[str, ...], float], _Changed] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that every push must bring."""
        names = [RECORDING] if self.mechanics.supports else []
        names += [need for name in self.values for need in BY_NAME[name].needs]
        return tuple(dict.fromkeys(names))

    @property
    def outline(self) -> Outline:
        """Of the slider."""
        return self.mechanics.outline

    def displacement(self, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None) -> Array:
        """Displacement (n, 3: dx, dy in m, dtheta in rad); see PushMechanics.displacement."""
        push = Push(inputs, duration, covariates or {})
        return self.mechanics.displaced(self._rows, push, self._shape)[:, 0]

    def shifted(
        self,
        names: tuple[str, ...],
        changes: Array,
        push: Push,
        difference: float = DIFFERENCE,
        *,
        derivatives: bool = True,
    ) -> tuple[Array, Array]:
        """What changes (n, q) of the parameters `names` shift the displacement by (n, 3), and derivatives (n, q, 3).

        The heading of a push follows from that of the slider where it is given. difference: step to both sides for a
        derivative, in prior standard deviations. Without derivatives there are none, (n, 0, 3).
        """
        known = self._changed.get((names, difference))
        if known is None or "rim_exponent" in names:
            shape = self._changed_shape(names, changes, difference)
            heading = any(BY_NAME[name].needs for name in (*self.values, *names))
            known = _Changed(shape, self._moved(names, difference), heading)
            self._changed[names, difference] = known
        given = self._with_heading(push) if known.heading else push
        found = self.mechanics.shifted(self._row, known.shape, changes, known.moved, given, derivatives=derivatives)
        return found[:, 0], found[:, 1:]

    def _changed_shape(self, names: tuple[str, ...], changes: Array, difference: float) -> Shape:
        """Of changes and of none; where no rim changes it is the same for all changes of these parameters."""
        ends = np.tile(self._row, (2, 1))
        for k, name in enumerate(names):
            step = difference * BY_NAME[name].spread
            ends[:, COLUMN[name]] += min(changes[:, k].min() - step, 0.0), max(changes[:, k].max() + step, 0.0)
        return self.mechanics.shape_of(ends)

    @cached_property
    def _shape(self) -> Shape:
        return self.mechanics.shape_of(self._row)

    def _moved(self, names: tuple[str, ...], difference: float) -> Array:
        """The parameters of a difference, see PushMechanics.shifted. No friction and no inertia is below zero."""
        steps = [difference * BY_NAME[name].spread for name in names]
        least = [-self.value(name) if BY_NAME[name].low == 0.0 else -np.inf for name in names]
        return np.array([[COLUMN[name] for name in names], steps, least], dtype=np.float64)

    def value(self, name: str) -> float:
        """The value of a parameter: the fitted one, or the textbook's."""
        return self.values.get(name, BY_NAME[name].textbook)

    @cached_property
    def ellipsoid(self) -> PowerSurface:
        """The ellipsoidal limit surface with the length and centre of the pressure.

        Of recordings with different supports it takes the mean.
        """
        mechanics = self.mechanics
        supports = [mechanics.support] if mechanics.support is not None else list(mechanics.supports.values())
        supports = supports or [patch(mechanics.outline, self.value("rim_exponent"))]
        centre = np.mean([support.centre for support in supports], axis=0)
        shift = np.array([self.value("centre_x"), self.value("centre_y")])
        return PowerSurface(centre + shift, float(np.mean([support.length for support in supports])))

    @cached_property
    def _row(self) -> Array:
        row = TEXTBOOK.copy()
        for name, value in self.values.items():
            row[COLUMN[name]] = value
        return row

    @cached_property
    def _rows(self) -> Array:
        return self._row[None, None]

    def _with_heading(self, push: Push) -> Push:
        """The pushes with their heading in the world, from that of the slider where it is given."""
        if "slider_heading" not in push.covariates:
            return push
        normal = self.outline.inward_normal(push.inputs[:, 1])
        heading = push.covariates["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + push.inputs[:, 2]
        return Push(push.inputs, push.duration, {**push.covariates, "push_heading": heading})


def analytical_mechanics(
    outline: Outline,
    pusher_radius: float,
    contact_friction: float = TEXTBOOK_FRICTION,
    surface: PowerSurface | PressureDistribution | None = None,
) -> FittedMechanics:
    """The model of Lynch, Maekawa and Tanie 1992: quasi-static pushing on the ellipsoid of uniform pressure.

    pusher_radius in m; surface: another limit surface. Raises RigError for a radius or a friction that is not a finite
    number >= 0.
    """
    for name, value in (("pusher_radius", pusher_radius), ("contact_friction", contact_friction)):
        if not (np.isfinite(value) and value >= 0.0):
            raise RigError(f"{name}: {value!r} is not accepted, give a finite number >= 0")
    surface = uniform_ellipsoid(outline) if surface is None else surface
    mechanics = PushMechanics(outline, pusher_radius, surface, accuracy=ANALYTICAL_ACCURACY)
    return FittedMechanics(mechanics, {"contact_friction": contact_friction}, np.zeros((1, 1)))
