# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of the three kinds of push."""

from __future__ import annotations

from push_predictor.types import Array
from push_predictor_paper.claims.repeated_pushes.kinds_of_push_rules import (
    Figure,
    Kinds,
    final_spread,
    growth,
    relative_spread,
    resampled,
    spread,
    travel,
)
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import of_draws
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.section import Table
from push_predictor_paper.statistics.grid_maps import place_text


def kinds_table(grid: RepeatedGrid, kinds: Kinds) -> Table:
    """A row for each of the three pushes."""
    rows = tuple(_row(kinds, name, k, half) for name, k, half in three(kinds))
    broken = sum(len(c.paths) - len(p) for c, p in zip(kinds.cells, kinds.paths, strict=True))
    caption = (
        f"The three pushes of the grid on {grid.surface}, simulated, 1 cm at {1e3 * GRID_SPEED:.0f} mm/s. Chosen "
        f"among {len(kinds.cells)} that move the slider to their end ({kinds.dropped} do not, or begin at a corner). "
        f"Intervals resample repetitions; for the first two, the half that did not choose them. {broken} of "
        f"{sum(len(c.paths) for c in kinds.cells)} repetitions are dropped, see below."
    )
    head = (
        "push",
        "contact (of the side), angle",
        "repetitions",
        "displacement (mm)",
        "spread half-way (mm)",
        "spread at the end (mm)",
    )
    return Table(caption, (*head, "relative spread (%)", "growth", "p of the dip, family-wise"), rows)


def _row(kinds: Kinds, name: str, k: int, paths: Array) -> tuple[str, ...]:
    cells = (of_draws(*resampled(paths, figure)).cell(form) for figure, form in COLUMNS)
    return (name, place_of(kinds.cells[k]), str(len(paths)), *cells, f"{kinds.p[k].min():.2g}")


COLUMNS: tuple[tuple[Figure, str], ...] = (
    (lambda paths: 1e3 * travel(paths[:, -1]), ".2f"),
    (lambda paths: 1e3 * spread(paths[:, paths.shape[1] // 2, :2]), ".2f"),
    (lambda paths: 1e3 * final_spread(paths), ".2f"),
    (lambda paths: 100.0 * relative_spread(paths), ".1f"),
    (growth, ".2f"),
)


def three(kinds: Kinds) -> tuple[tuple[str, int, Array], ...]:
    """Name, place and test repetitions of each of the three pushes."""
    return (
        ("most convergent", kinds.convergent, kinds.paths[kinds.convergent][1::2]),
        ("most divergent", kinds.divergent, kinds.paths[kinds.divergent][1::2]),
        ("largest dip", kinds.modal, kinds.paths[kinds.modal]),
    )


def place_of(cell: Repetitions) -> str:
    """Contact and angle, in words."""
    return place_text((cell.fraction, cell.angle))
