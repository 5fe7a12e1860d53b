# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How strongly a mechanism acts as a function of a covariate: linear, logarithmic, step, periodic, or a map of two."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array


@dataclass(frozen=True)
class DriverBasis:
    """A basis of functions of one covariate.

    name: one of BASES. centre, scale: of the covariate. place: of a step.

    drivers: names of the covariates it takes: one, or two for a map; none for a constant. levels: of a category, the
    first is the one that the others are compared with. offset: whether a constant is the first column, so that the
    effect need not be zero anywhere.
    """

    name: str
    drivers: tuple[str, ...] = ()
    centre: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()
    place: float = 0.0
    levels: tuple[float, ...] = ()
    offset: bool = False

    @property
    def is_constant(self) -> bool:
        """Whether the effect is the same at every value of its covariate."""
        return self.name == "constant"

    def values(self, covariates: Mapping[str, Array], n: int) -> Array:
        """The columns (n, m) of the basis at n pushes; a constant is one column of ones."""
        columns = [np.asarray(covariates[name], dtype=np.float64) for name in self.drivers]
        values = BASES[self.name](self, columns, n)
        return np.column_stack([np.ones(n), values]) if self.offset else values


def _scaled(basis: DriverBasis, columns: list[Array]) -> list[Array]:
    return [(column - c) / s for column, c, s in zip(columns, basis.centre, basis.scale, strict=True)]


def _constant(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    return np.ones((n, 1))


def _linear(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    return _scaled(basis, columns)[0][:, None]


def _logarithmic(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    """Logarithm of the distance from the start of the covariate's range, in units of its scale."""
    return np.log1p(np.maximum((columns[0] - basis.place) / basis.scale[0], 0.0))[:, None]


def _quadratic(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    x = _scaled(basis, columns)[0]
    return np.column_stack([x, x**2])


def _step(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    return (columns[0] >= basis.place).astype(np.float64)[:, None]


def _periodic(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    """One period per turn of a heading."""
    return np.column_stack([np.cos(columns[0]), np.sin(columns[0])])


def _periodic_twice(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    """Two periods per turn of a heading: the same for opposite headings."""
    return np.column_stack([np.cos(2.0 * columns[0]), np.sin(2.0 * columns[0])])


def _category(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    return np.column_stack([(columns[0] == level).astype(np.float64) for level in basis.levels[1:]])


def _map(basis: DriverBasis, columns: list[Array], n: int) -> Array:
    """A second-order polynomial of two covariates."""
    x, y = _scaled(basis, columns)
    return np.column_stack([x, y, x * y, x**2, y**2])


BASES: dict[str, Callable[[DriverBasis, list[Array], int], Array]] = {
    "constant": _constant,
    "linear": _linear,
    "logarithmic": _logarithmic,
    "quadratic": _quadratic,
    "step": _step,
    "periodic": _periodic,
    "periodic, twice around": _periodic_twice,
    "category": _category,
    "map": _map,
}


def columns_of(basis: DriverBasis) -> int:
    """Number of columns of a basis."""
    return int(basis.values({name: np.zeros(1) for name in basis.drivers}, 1).shape[1])
