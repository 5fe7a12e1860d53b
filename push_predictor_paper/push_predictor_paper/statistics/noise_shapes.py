# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Agreement of the noise of one slider on different surfaces: correlation of the maps of log sd."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations

import numpy as np
from scipy.stats import rankdata

from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.fits.map_models import ModelMap
from push_predictor_paper.statistics.grid_maps import block_weights, by_blocks, correlation

FEWEST_PUSHES = 8


@dataclass(frozen=True)
class Shape:
    """Correlations of log sd by output between two surfaces, or two halves of one surface's repetitions."""

    first: str
    second: str
    pushes: int
    pearson: tuple[Estimate, ...]
    spearman: tuple[Estimate, ...]


def shapes(grids: Mapping[str, RepeatedGrid], widest: float = np.inf) -> list[Shape]:
    """Correlations for all pairs of surfaces, over pushes known on both with |angle| (rad) up to `widest`."""
    pairs = [(a, b, _shared(grids[a], grids[b], widest)) for a, b in combinations(grids, 2)]
    return [
        _shape((a, b), [one for one, _ in cells], _sd([one for one, _ in cells]), _sd([other for _, other in cells]))
        for a, b, cells in pairs
        if len(cells) >= FEWEST_PUSHES
    ]


def ceiling(grid: RepeatedGrid, widest: float = np.inf) -> Shape | None:
    """Correlation between two halves of one surface's repetitions: the largest that is possible."""
    cells = [cell for cell in grid.seen if abs(cell.angle) <= widest]
    if len(cells) < FEWEST_PUSHES:
        return None
    halves = [np.array([cell.outcomes[start::2].std(axis=0, ddof=1) for cell in cells]) for start in (0, 1)]
    return _shape((f"{grid.surface}, odd", "even repetitions"), cells, halves[0], halves[1])


def learned_shapes(grids: Mapping[str, RepeatedGrid], models: Mapping[str, ModelMap]) -> list[Shape]:
    """Correlations of the process noise of the surfaces' models, at pushes known on both."""
    sds: dict[str, dict[tuple[float, float], Array]] = {}
    for surface, model in models.items():
        if model.at_pushes is not None:
            names = [(cell.fraction, cell.angle) for cell in grids[surface].seen]
            sds[surface] = dict(zip(names, model.at_pushes.process_sd, strict=True))
    found = []
    for a, b in combinations(sds, 2):
        cells = [cell for cell, _ in _shared(grids[a], grids[b], np.inf)]
        one, other = (np.array([sds[s][cell.fraction, cell.angle] for cell in cells]) for s in (a, b))
        if len(cells) >= FEWEST_PUSHES:
            found.append(_shape((a, b), cells, one, other))
    return found


def _shape(names: tuple[str, str], cells: list[Repetitions], one: Array, other: Array) -> Shape:
    weights, logs = block_weights(cells), (np.log(one), np.log(other))
    ranks = tuple(rankdata(log, axis=0) for log in logs)  # of all pushes; a draw keeps them
    pearson, spearman = (
        tuple(by_blocks(partial(correlation, a[:, k], b[:, k]), weights) for k in range(3)) for a, b in (logs, ranks)
    )
    return Shape(*names, len(cells), pearson, spearman)


def _shared(one: RepeatedGrid, other: RepeatedGrid, widest: float) -> list[tuple[Repetitions, Repetitions]]:
    second = {(cell.fraction, cell.angle): cell for cell in other.seen}
    return [
        (cell, second[cell.fraction, cell.angle])
        for cell in one.seen
        if (cell.fraction, cell.angle) in second and abs(cell.angle) <= widest
    ]


def _sd(cells: list[Repetitions]) -> Array:
    return np.array([cell.sd for cell in cells])
