# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes to be predicted: scalars, lists or arrays in, checked columns out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.recordings.table import INPUTS, PushTable
from push_predictor.types import Array, BoolArray, IntArray

Numbers = float | Sequence[float] | np.ndarray
DEFAULT_DURATION = 0.2  # s, the length of a window unless something else is stated


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Pushes:
    """n pushes, checked: inputs (n, 3: velocity m/s, contact, angle rad), duration (n,) s, covariates (n,) by name."""

    inputs: Array
    duration: Array
    covariates: dict[str, Array]

    def __init__(
        self,
        velocity: Numbers,
        contact: Numbers,
        angle: Numbers,
        duration: Numbers = DEFAULT_DURATION,
        covariates: Mapping[str, Numbers] | None = None,
    ) -> None:
        """Take a number, which applies to all pushes, or n numbers for each field.

        velocity: of the pusher, m/s. contact: fraction of the outline's perimeter in [0, 1). angle: from the inward
        normal to the pusher's velocity, rad, counter-clockwise positive. duration: s. covariates: what an extended
        model needs in addition, by name.
        Raises RequestError that names the field if a value is not a finite number or if lengths differ. Whether a
        model can predict a push is checked by `PushModel.predict`.
        """
        given = {"velocity": velocity, "contact": contact, "angle": angle, "duration": duration}
        given |= {f"covariate {name}": value for name, value in (covariates or {}).items()}
        columns = _same_length({name: _column(name, value) for name, value in given.items()})
        object.__setattr__(self, "inputs", np.column_stack([columns.pop(name) for name in INPUTS]))
        object.__setattr__(self, "duration", columns.pop("duration"))
        object.__setattr__(self, "covariates", dict(zip(covariates or {}, columns.values(), strict=True)))

    def __len__(self) -> int:
        return len(self.inputs)

    def __repr__(self) -> str:
        columns = {**dict(zip(INPUTS, self.inputs.T, strict=True)), "duration": self.duration, **self.covariates}
        ranges = ", ".join(f"{name} {_range(column)}" for name, column in columns.items())
        return f"Pushes(n={len(self)}: {ranges})"


def _column(name: str, value: Numbers) -> Array:
    try:
        column = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise RequestError(name, repr(value), "a number or a list of numbers") from None
    if column.ndim > 1:
        raise RequestError(name, f"an array of shape {column.shape}", "a number or n numbers")
    if not column.size:
        raise RequestError(name, "an empty list", "at least one number")
    column = np.atleast_1d(column)
    if (bad := np.flatnonzero(~np.isfinite(column))).size:
        raise RequestError(f"{name}[{bad[0]}]" if len(column) > 1 else name, float(column[bad[0]]), "a finite number")
    return column


def _same_length(columns: Mapping[str, Array]) -> dict[str, Array]:
    """The columns, those of one number repeated to the length of the others."""
    longest = max(columns, key=lambda name: len(columns[name]))
    n = len(columns[longest])
    for name, column in columns.items():
        if len(column) not in (1, n):
            raise RequestError(name, f"{len(column)} numbers", f"one number, or {n} as in {longest}")
    return {name: np.repeat(column, n) if len(column) < n else column for name, column in columns.items()}


def _range(column: Array) -> str:
    low, high = float(column.min()), float(column.max())
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


@dataclass(frozen=True, eq=False)
class Push:
    """n pushes: inputs (n, 3: velocity m/s, contact, angle rad), duration (n,) s, covariates (n,) each by name."""

    inputs: Array
    duration: Array
    covariates: Mapping[str, Array]

    @staticmethod
    def of(table: PushTable) -> Push:
        """The pushes of a table's windows."""
        return Push(table.inputs, table.duration, table.covariates)

    def take(self, rows: IntArray | BoolArray | slice) -> Push:
        """Some of these pushes."""
        covariates = {name: column[rows] for name, column in self.covariates.items()}
        return Push(self.inputs[rows], self.duration[rows], covariates)
