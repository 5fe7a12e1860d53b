# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The push table: one row per window or per push; the data of models and metrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from push_predictor.errors import TableError
from push_predictor.types import Array, IntArray, TextArray

INPUTS = ("velocity", "contact", "angle")
OUTPUTS = ("dx", "dy", "dtheta")
COLUMNS = ("velocity", "contact", "angle", "duration", "dx", "dy", "dtheta", "push_id")


@dataclass(frozen=True, eq=False)
class PushTable:
    """n windows.

    inputs (n, 3): velocity m/s, contact fraction of the perimeter, angle rad. duration (n,) s.
    outcomes (n, 3): dx m, dy m, dtheta rad in the push frame. push_id (n,) text: the same for all windows of a push.
    covariates: by name, (n,) each.
    """

    inputs: Array
    duration: Array
    outcomes: Array
    push_id: TextArray
    covariates: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.inputs)
        shapes = {
            "inputs": (self.inputs, (n, 3)),
            "duration": (self.duration, (n,)),
            "outcomes": (self.outcomes, (n, 3)),
            "push_id": (self.push_id, (n,)),
            **{name: (column, (n,)) for name, column in self.covariates.items()},
        }
        for name, (column, shape) in shapes.items():
            if np.shape(column) != shape:
                raise TableError(f"{name}: shape {np.shape(column)}, give {shape}")

    def __len__(self) -> int:
        return len(self.inputs)

    @property
    def pushes(self) -> list[str]:
        """The distinct pushes, in order of first appearance."""
        return list(dict.fromkeys(self.push_id.tolist()))

    def take(self, rows: IntArray | np.ndarray) -> PushTable:
        """The given rows (indices or a mask)."""
        return PushTable(
            self.inputs[rows],
            self.duration[rows],
            self.outcomes[rows],
            self.push_id[rows],
            {name: column[rows] for name, column in self.covariates.items()},
        )


def empty_table() -> PushTable:
    """A table without rows."""
    return PushTable(np.empty((0, 3)), np.empty(0), np.empty((0, 3)), np.empty(0, dtype=np.str_))


def concatenate(tables: Sequence[PushTable]) -> PushTable:
    """The rows of all tables; a covariate is kept if all tables have it.

    Raises TableError without a table.
    """
    if not tables:
        raise TableError("no push table was given, give at least one recording or table")
    names = [name for name in tables[0].covariates if all(name in table.covariates for table in tables)]
    return PushTable(
        np.concatenate([table.inputs for table in tables]),
        np.concatenate([table.duration for table in tables]),
        np.concatenate([table.outcomes for table in tables]),
        np.concatenate([table.push_id for table in tables]),
        {name: np.concatenate([table.covariates[name] for table in tables]) for name in names},
    )
