# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Effects as changes of parameters of the mechanics: exact for large changes, and together, since changes add up."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis, columns_of
from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.kernel.push import propagated
from push_predictor.models.mechanisms import LARGEST
from push_predictor.models.pushes import Push
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class JointEffects:
    """Effects that change parameters of the mechanics, as one set of m coefficients that change q parameters."""

    effects: tuple[Effect, ...]

    @staticmethod
    def of(effects: Sequence[Effect]) -> JointEffects:
        """Those of some effects that have a mechanism."""
        return JointEffects(tuple(effect for effect in effects if effect.exact))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that change, each once."""
        return tuple(dict.fromkeys(name for effect in self.effects for name in effect.quantities))

    @cached_property
    def _bases(self) -> tuple[DriverBasis, ...]:
        """The bases of all effects, each once."""
        return tuple(dict.fromkeys(effect.basis for effect in self.effects))

    def columns(self, push: Push) -> Array:
        """The columns (n, b) of the bases, one after the other."""
        values = [basis.values(push.covariates, len(push.inputs)) for basis in self._bases]
        return values[0] if len(values) == 1 else np.concatenate(values, axis=1)

    def changes(self, columns: Array) -> Array:
        """The changes (n, q), at most the largest that a rig can have."""
        return np.asarray(np.minimum(np.maximum(columns.dot(self._weights), self._least), self._largest))

    def shifted(
        self, mechanics: FittedMechanics, push: Push, *, derivatives: bool = True
    ) -> tuple[Array, Array, Array]:
        """Shift (n, 3) of the mean, its derivatives (n, q, 3) by the parameters, and the columns (n, b)."""
        columns = self.columns(push)
        return *mechanics.shifted(self.names, self.changes(columns), push, derivatives=derivatives), columns

    def design(self, columns: Array, slopes: Array) -> Array:
        """Derivatives (n, m, 3) by the coefficients, from those (n, q, 3) by the parameters."""
        parameter, column = self._acting
        return np.asarray(slopes[:, parameter] * columns[:, column, None])

    def uncertainty(self, columns: Array, slopes: Array, covariance: Array) -> Array:
        """Covariance (n, 3, 3) of the shift for that (m, m) of the coefficients; slopes as in `design`."""
        found = np.empty((len(columns), 3, 3))
        propagated(slopes, columns, self._acting, covariance, found)
        return found

    @cached_property
    def _acting(self) -> IntArray:
        """The parameter and the column of the bases that each coefficient acts on, (2, m)."""
        ends = np.cumsum([columns_of(basis) for basis in self._bases]).tolist()
        columns_of_basis = dict(zip(self._bases, map(range, [0, *ends], ends), strict=False))
        parameters, columns = [], []
        for effect in self.effects:
            own, used = [self.names.index(name) for name in effect.quantities], columns_of_basis[effect.basis]
            parameters.append(np.repeat(own, len(used)))
            columns.append(np.tile(used, len(own)))
        return np.array([np.concatenate(parameters), np.concatenate(columns)], dtype=np.intp)

    @cached_property
    def _weights(self) -> Array:
        """What a unit of each column changes, (b, q)."""
        parameter, column = self._acting
        weights = np.zeros((int(column.max()) + 1, len(self.names)))
        np.add.at(weights, (column, parameter), np.concatenate([effect.coefficients for effect in self.effects]))
        return weights

    @cached_property
    def _largest(self) -> Array:
        return np.array([LARGEST[name] for name in self.names])

    @cached_property
    def _least(self) -> Array:
        return -self._largest


class JointShift(NamedTuple):
    """Shift (n, 3) of the mean; per effect, its derivatives (n, 3, p * m) by the coefficients."""

    shift: Array
    designs: list[Array]


def joint_shift(mechanics: FittedMechanics, effects: Sequence[Effect], push: Push) -> Array:
    """Shift of the mean (n, 3) by all effects together."""
    return joint(mechanics, effects, push, derivatives=False).shift


def joint(mechanics: FittedMechanics, effects: Sequence[Effect], push: Push, *, derivatives: bool = True) -> JointShift:
    """The shift by all effects together, and its derivatives by their coefficients."""
    acting, shift, designs = JointEffects.of(effects), np.zeros((len(push.inputs), 3)), []
    exact: Iterator[Array] = iter(())
    if acting.effects:
        shift, slopes, columns = acting.shifted(mechanics, push, derivatives=derivatives)
        if derivatives:
            exact = iter(np.split(acting.design(columns, slopes).transpose(0, 2, 1), _ends(acting.effects), axis=2))
    for effect in effects:
        if not effect.exact:
            designs.append(effect.design(mechanics, push))
            shift = shift + designs[-1] @ effect.coefficients
        elif derivatives:
            designs.append(next(exact))
    return JointShift(shift, designs)


def _ends(effects: Sequence[Effect]) -> IntArray:
    """Where the coefficients of each effect end among all, but for the last."""
    return np.cumsum([len(effect.coefficients) for effect in effects])[:-1]


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
