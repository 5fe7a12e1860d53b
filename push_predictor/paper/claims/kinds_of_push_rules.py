"""Which repeated pushes are the convergent, the divergent and the most bimodal one, and by which rule they are it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.unimodality import dip, holm, p_values
from push_predictor.paper.densities import RESOLUTION
from push_predictor.paper.estimate import Estimate
from push_predictor.paper.plan import GRID_SPEED
from push_predictor.paper.repetitions import DRAWS, FEWEST, STEP, RepeatedGrid, Repetitions
from push_predictor.paper.section import Verdict
from push_predictor.types import Array

LEVEL = 0.05
FAR, POWER = 6.0, 0.8  # two equal modes so many of their sd apart should be found so often
LEAST_TRAVEL = 0.002  # m: below it the tip grazes, and a spread relative to the way says little
LARGEST_STEP = 3.0 * GRID_SPEED * STEP * 1e-9  # m between points of a path: the tip cannot have pushed so far
Figure = Callable[[Array], float]  # of paths (r, t, 3)
APART = 2.0  # how much further apart, relative to the way, divergent pushes should end than convergent ones


@dataclass(frozen=True, eq=False)
class Kinds:
    """A grid's pushes that move the slider, with their whole paths.

    Places of the three chosen ones; p (p, 3): family-wise p values of the dip of final x, y and heading.
    """

    cells: tuple[Repetitions, ...]
    paths: tuple[Array, ...]
    convergent: int
    divergent: int
    modal: int
    p: Array


def kinds_of(grid: RepeatedGrid) -> Kinds | None:
    """Choose the three pushes; None if there are not two that move the slider."""
    whole = [(cell, whole_paths(cell.paths)) for cell in grid.seen]
    seen = [(cell, paths) for cell, paths in whole if len(paths) >= FEWEST]
    moved = [(cell, paths) for cell, paths in seen if travel(paths[:, -1]) >= LEAST_TRAVEL]
    if len(moved) < 2:
        return None
    paths = tuple(paths for _, paths in moved)
    order = sorted(range(len(paths)), key=lambda k: relative_spread(paths[k][::2]))
    p = _modes(paths)
    modal = int(np.argmin(p.min(axis=1)))
    return Kinds(tuple(cell for cell, _ in moved), paths, order[0], order[-1], modal, holm(p.ravel()).reshape(p.shape))


def whole_paths(paths: Array) -> Array:
    """Those of paths (r, t, 3) along which the slider never moves further than the tip could push it."""
    steps = np.hypot(*np.moveaxis(np.diff(paths[..., :2], axis=1), -1, 0))
    return np.asarray(paths[steps.max(axis=1) <= LARGEST_STEP])


def relative_spread(paths: Array, place: int = -1) -> float:
    """Spread of paths (r, t, 3) at a place along them over the mean displacement there."""
    ends = paths[:, place, :2]
    return float(spread(ends) / travel(ends))


def growth(paths: Array) -> float:
    """Relative spread at the end over that half-way: above 1 paths fan out."""
    return relative_spread(paths) / relative_spread(paths, paths.shape[1] // 2)


def resampled(paths: Array, figure: Figure, seed: int = 0) -> tuple[float, Array]:
    """A figure of paths (r, t, 3), and its draws (DRAWS,) of repetitions."""
    rows = np.random.default_rng(seed).integers(0, len(paths), (DRAWS, len(paths)))
    return float(figure(paths)), np.array([figure(paths[drawn]) for drawn in rows])


def apart(ratio: Estimate) -> Verdict:
    """ratio: relative spread of the divergent push over that of the convergent one."""
    if ratio.low > 1.0:
        return "holds" if ratio.low > APART else "holds in part"
    return "does not hold" if ratio.high < APART else "not decided"


def draws_together_fans_out(convergent: Estimate, divergent: Estimate) -> Verdict:
    """Growth of the relative spread of the two pushes along their second half."""
    right = (convergent.high < 1.0) + (divergent.low > 1.0)
    if right:
        return "holds" if right == 2 else "holds in part"
    return "does not hold" if convergent.low > 1.0 or divergent.high < 1.0 else "not decided"


def has_modes(p: float, power: float) -> Verdict:
    """The least family-wise p of all pushes, and how surely modes far apart would be found."""
    if p <= LEVEL:
        return "holds"
    return "does not hold" if power >= POWER else "not decided"


def _modes(paths: Sequence[Array]) -> Array:
    draws = RESOLUTION * 3 * len(paths)
    return np.array([p_values(dip(one[:, -1].T), len(one), draws) for one in paths])


def spread(ends: Array) -> float:
    """Root mean square distance of points ends (r, 2) from their mean."""
    return float(np.sqrt(np.sum(np.var(ends, axis=0, ddof=1))))


def travel(ends: Array) -> float:
    """Length of the mean displacement of ends (r, 2 or 3)."""
    return float(np.hypot(*ends[:, :2].mean(axis=0)))
