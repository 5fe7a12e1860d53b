# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of the noise of repeated pushes relative to the mean outcome, and its range over the inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.statistics.grid_maps import block_weights, by_blocks, redrawn, unbiased

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


@dataclass(frozen=True)
class Span:
    """Range of the sd over pushes: 95th over 5th percentile, largest over smallest."""

    most: Estimate
    extreme: Estimate


def noise_ratios(cells: list[Repetitions], arm: float) -> tuple[Ratios, ...]:
    """Ratios of dx, dy, dtheta and the whole motion; rotations count as the arc (m) at radius `arm` (m)."""
    mean, sd = np.array([cell.mean for cell in cells]), np.array([cell.sd for cell in cells])
    weights, metres = block_weights(cells), np.array([1.0, 1.0, arm])
    whole = [np.sqrt(np.sum((part * metres) ** 2, axis=1)) for part in (mean, sd)]
    parts = [(np.abs(mean[:, k]), sd[:, k]) for k in range(3)]
    return tuple(_ratios(m, s, weights) for m, s in (*parts, (whole[0], whole[1])))


def spans(cells: list[Repetitions]) -> tuple[Span, ...]:
    """Ranges of the sds of dx, dy, dtheta; intervals resample repetitions, not pushes."""
    sd, drawn = np.array([cell.sd for cell in cells]), redrawn(cells)[1]
    return tuple(
        Span(*(_corrected(figure(sd[None, :, k]), figure(drawn[..., k])) for figure in (_most, _extreme)))
        for k in range(3)
    )


def span_of(values: Array) -> float:
    """95th over 5th percentile of sds (m,)."""
    return float(_most(values[None])[0])


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


def _corrected(value: Array, draws: Array) -> Estimate:
    logs = unbiased(float(np.log(value[0])), np.log(draws))
    return Estimate(*np.exp([logs.value, logs.low, logs.high]).tolist())


def _most(sd: Array) -> Array:
    low, high = np.quantile(sd, [0.05, 0.95], axis=1)
    return np.asarray(high / low)


def _extreme(sd: Array) -> Array:
    return np.asarray(sd.max(axis=1) / sd.min(axis=1))
