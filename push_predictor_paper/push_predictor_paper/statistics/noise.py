# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The noise of repeated pushes: its size relative to the mean outcome, its range, its agreement between surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.fits.map_models import ModelMap
from push_predictor_paper.statistics.grid_maps import (
    FEWEST_PUSHES,
    Place,
    block_weights,
    by_blocks,
    correlation,
    redrawn,
    unbiased,
)

LOW, HIGH = 0.1, 0.4  # of the expected output, the paper's
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


@dataclass(frozen=True, eq=False)
class Ratios:
    """sd over |mean| of m pushes, of one output or of the whole motion.

    values (m,); quantiles: of these; within: share of the pushes between 10 and 40 %; overall: root mean square of
    the sd over that of the mean.
    """

    values: Array
    quantiles: tuple[float, ...]
    within: Estimate
    overall: Estimate


def noise_ratios(cells: list[Repetitions], arm: float) -> tuple[Ratios, ...]:
    """Ratios of dx, dy, dtheta and the whole motion; rotations count as the arc (m) at radius `arm` (m)."""
    mean, sd = np.array([cell.mean for cell in cells]), np.array([cell.sd for cell in cells])
    weights, metres = block_weights(cells), np.array([1.0, 1.0, arm])
    whole = [np.sqrt(np.sum((part * metres) ** 2, axis=1)) for part in (mean, sd)]
    parts = [(np.abs(mean[:, k]), sd[:, k]) for k in range(3)]
    return tuple(_ratios(m, s, weights) for m, s in (*parts, (whole[0], whole[1])))


def spans(cells: list[Repetitions]) -> tuple[Estimate, ...]:
    """95th over 5th percentile of the sds of dx, dy, dtheta over pushes; intervals resample repetitions, not pushes."""
    sd, drawn = np.array([cell.sd for cell in cells]), redrawn(cells)[1]
    logs = [unbiased(float(np.log(span_of(sd[:, k]))), np.log(_span(drawn[..., k]))) for k in range(3)]
    return tuple(Estimate(*np.exp([log.value, log.low, log.high]).tolist()) for log in logs)


def span_of(values: Array) -> float:
    """95th over 5th percentile of sds (m,)."""
    return float(_span(values[None])[0])


def radius_of_gyration(grid: RepeatedGrid) -> float:
    """Radius of gyration of a plate with the slider's outline about its centroid, m."""
    corners = grid.rig.outline.vertices
    after = np.roll(corners, -1, axis=0)
    cross = corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]
    squares = np.sum(corners**2 + corners * after + after**2, axis=1)
    return float(np.sqrt(np.sum(cross * squares) / (6.0 * np.sum(cross))))


def _ratios(mean: Array, sd: Array, weights: Array) -> Ratios:
    values = sd / mean
    inside = ((values >= LOW) & (values <= HIGH)).astype(np.float64)
    return Ratios(
        values,
        tuple(np.quantile(values, QUANTILES).tolist()),
        by_blocks(lambda w: w @ inside / w.sum(axis=1), weights),
        by_blocks(lambda w: np.sqrt((w @ sd**2) / (w @ mean**2)), weights),
    )


def _span(sd: Array) -> Array:
    low, high = np.quantile(sd, [0.05, 0.95], axis=1)
    return np.asarray(high / low)


@dataclass(frozen=True)
class Shape:
    """Correlations of log sd by output between two surfaces, or two halves of one surface's repetitions."""

    first: str
    second: str
    pushes: int
    correlations: tuple[Estimate, ...]


def repeated_shapes(grids: Mapping[str, RepeatedGrid]) -> list[Shape]:
    """Correlations for all pairs of surfaces, over pushes known on both."""
    return _pairs({s: {_place(cell): cell.sd for cell in grid.seen} for s, grid in grids.items()}, grids)


def ceiling(grid: RepeatedGrid) -> Shape | None:
    """Correlation between two halves of one surface's repetitions: the largest that is possible."""
    cells = grid.seen
    if len(cells) < FEWEST_PUSHES:
        return None
    halves = [np.array([cell.outcomes[start::2].std(axis=0, ddof=1) for cell in cells]) for start in (0, 1)]
    return _shape((f"{grid.surface}, odd", "even repetitions"), cells, halves[0], halves[1])


def learned_shapes(grids: Mapping[str, RepeatedGrid], models: Mapping[str, ModelMap]) -> list[Shape]:
    """Correlations of the process noise of the surfaces' models, at pushes known on both."""
    answers = {surface: model.at_pushes.process_sd for surface, model in models.items() if model.at_pushes is not None}
    return _pairs({s: dict(zip(map(_place, grids[s].seen), sds, strict=True)) for s, sds in answers.items()}, grids)


def _shape(names: tuple[str, str], cells: list[Repetitions], one: Array, other: Array) -> Shape:
    weights, logs = block_weights(cells), (np.log(one), np.log(other))
    return Shape(
        *names,
        len(cells),
        tuple(by_blocks(partial(correlation, logs[0][:, k], logs[1][:, k]), weights) for k in range(3)),
    )


def _pairs(sds: Mapping[str, Mapping[Place, Array]], grids: Mapping[str, RepeatedGrid]) -> list[Shape]:
    """Correlations of sds (3,) by surface and place, for all pairs of surfaces with enough common places."""
    found = []
    for a, b in combinations(sds, 2):
        cells = [cell for cell in grids[a].seen if _place(cell) in sds[a] and _place(cell) in sds[b]]
        if len(cells) >= FEWEST_PUSHES:
            one, other = (np.array([sds[surface][_place(cell)] for cell in cells]) for surface in (a, b))
            found.append(_shape((a, b), cells, one, other))
    return found


def _place(cell: Repetitions) -> Place:
    return cell.fraction, cell.angle
