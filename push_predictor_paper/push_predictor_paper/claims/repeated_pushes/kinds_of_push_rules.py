# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rules that choose the most convergent, divergent and multi-modal push, and those of the verdicts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.data.repetitions import DRAWS, FEWEST, STEP, RepeatedGrid, Repetitions
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.section import Verdict
from push_predictor_paper.statistics.densities import RESOLUTION
from push_predictor_paper.statistics.unimodality import dip, holm, p_values

LEVEL = 0.05
FAR, POWER = 6.0, 0.8  # two equal modes so many of their sd apart should be found so often
EDGE = 0.05  # of the side from its ends: there the tip starts on the corner, which is another kind of contact
LAST = round(0.1 / (STEP * 1e-9))  # points of a path: its last 0.1 s
STILL = 0.1 * LAST * GRID_SPEED * STEP * 1e-9  # m: a tenth of the tip's way in that time
STILL_TURN = float(np.radians(0.3))  # the tracker's noise, several times over
STOPPED = 0.05  # of the repetitions: pushes of which more stop early are of tips that slid off
LEAST_TRAVEL = 0.002  # m: below it the tip grazes, and a spread relative to the distance means little
LARGEST_STEP = 3.0 * GRID_SPEED * STEP * 1e-9  # m between points of a path: the tip cannot have pushed so far
Figure = Callable[[Array], Array]  # of paths (..., r, t, 3), (...): by their beginning, middle and end
APART = 2.0  # how much further apart divergent pushes should end than convergent ones


@dataclass(frozen=True, eq=False)
class Kinds:
    """A grid's pushes that move the slider to their end, with their whole paths.

    convergent, divergent, modal: indices of the chosen pushes. p (p, 3): family-wise p values of the dip of final x, y
    and heading. dropped: number of pushes of the grid that are not among them.
    """

    cells: tuple[Repetitions, ...]
    paths: tuple[Array, ...]
    convergent: int
    divergent: int
    modal: int
    p: Array
    dropped: int


def kinds_of(grid: RepeatedGrid) -> Kinds | None:
    """Choose the three pushes; None if there are not two that move the slider."""
    whole = [(cell, whole_paths(cell.paths)) for cell in grid.seen]
    kept = [(cell, paths) for cell, paths in whole if EDGE < cell.fraction < 1.0 - EDGE and to_the_end(paths)]
    if len(kept) < 2:
        return None
    cells, paths = zip(*kept, strict=True)
    order = np.argsort([growth(one[::2]) for one in paths])
    p = _modes(paths)
    modal, several = int(np.argmin(p.min(axis=1))), holm(p.ravel()).reshape(p.shape)
    return Kinds(cells, paths, int(order[0]), int(order[-1]), modal, several, len(grid.cells) - len(kept))


def to_the_end(paths: Array) -> bool:
    """Whether the push of paths (r, t, 3) moves the slider, in nearly all of them up to its end."""
    if len(paths) < FEWEST or travel(paths[:, -1]) < LEAST_TRAVEL:
        return False
    last = paths[:, -1] - paths[:, -1 - LAST]
    still = (np.hypot(last[:, 0], last[:, 1]) < STILL) & (np.abs(last[:, 2]) < STILL_TURN)
    return bool(still.mean() <= STOPPED)


def whole_paths(paths: Array) -> Array:
    """The paths (r, t, 3) along which the slider never moves further than the tip could push it."""
    steps = np.hypot(*np.moveaxis(np.diff(paths[..., :2], axis=1), -1, 0))
    return np.asarray(paths[steps.max(axis=1) <= LARGEST_STEP])


def relative_spread(paths: Array, place: int = -1) -> Array:
    """Spread of paths (..., r, t, 3) at a place along them over the mean displacement there, (...)."""
    ends = paths[..., place, :2]
    return spread(ends) / travel(ends)


def final_spread(paths: Array) -> Array:
    """Spread (m) of the ends of paths (..., r, t, 3), (...)."""
    return spread(paths[..., -1, :2])


def growth(paths: Array) -> Array:
    """Relative spread at the end over that half-way, (...); above 1 the paths (..., r, t, 3) fan out."""
    return relative_spread(paths) / relative_spread(paths, _middle(paths))


def resampled(paths: Array, figure: Figure, seed: int = 0) -> tuple[float, Array]:
    """A figure of paths (r, t, 3), and its resamples (DRAWS,) over repetitions."""
    rows = np.random.default_rng(seed).integers(0, len(paths), (DRAWS, len(paths)))
    return float(figure(paths)), figure(paths[:, [0, _middle(paths), -1]][rows])


def _middle(paths: Array) -> int:
    return int(paths.shape[-2]) // 2


def apart(ratios: Sequence[Estimate]) -> Verdict:
    """Verdict. ratios: final spread of the divergent over that of the convergent push, absolute and relative."""
    if all(ratio.low > APART for ratio in ratios):
        return "holds"
    if all(ratio.low > 1.0 for ratio in ratios):
        return "holds in part"
    return "does not hold" if any(r.low <= 1.0 and r.high < APART for r in ratios) else "not decided"


def draws_together_fans_out(convergent: Estimate, divergent: Estimate) -> Verdict:
    """Verdict by the growth of the relative spread of the two pushes."""
    right = (convergent.high < 1.0) + (divergent.low > 1.0)
    if right:
        return "holds" if right == 2 else "holds in part"
    return "does not hold" if convergent.low > 1.0 or divergent.high < 1.0 else "not decided"


def has_modes(p: float, power: float) -> Verdict:
    """Verdict by the least family-wise p of all pushes, and the power of the test."""
    if p <= LEVEL:
        return "holds"
    return "does not hold" if power >= POWER else "not decided"


def _modes(paths: Sequence[Array]) -> Array:
    draws = RESOLUTION * 3 * len(paths)
    return np.array([p_values(dip(one[:, -1].T), len(one), draws) for one in paths])


def spread(ends: Array) -> Array:
    """Root mean square distance of points ends (..., r, 2) from their mean, (...)."""
    return np.asarray(np.sqrt(np.sum(np.var(ends, axis=-2, ddof=1), axis=-1)))


def travel(ends: Array) -> Array:
    """Length of the mean displacement of ends (..., r, 2 or 3), (...)."""
    return np.asarray(np.linalg.norm(ends[..., :2].mean(axis=-2), axis=-1))
