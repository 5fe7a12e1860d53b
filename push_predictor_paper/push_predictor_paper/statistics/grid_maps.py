# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Arithmetic of maps over (contact, angle): resampling, interpolation, agreement of two maps, the maximum of one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import Repetitions

BLOCK = (0.2, 0.4)  # of the side, rad: neighbouring pushes are alike and are resampled as a block
DRAWS = 400
SURE = 0.95
STEP = 0.1  # of the side, and rad: the paper's grid
FEWEST_PUSHES = 8  # of a grid, to compare maps
ROUNDING = 1e-9
Place = tuple[float, float]  # contact as a fraction of the side, angle in rad
Statistic = Callable[[Array, Array], Array]  # of values (m,) and weights (d, m): (d,)


def place_text(place: Place) -> str:
    """A push in words: contact as a fraction of the side, angle in degrees."""
    return f"c = {place[0]:.2f}, {in_degrees(place[1])}"


def in_degrees(angle: float) -> str:
    """An angle (rad) in degrees, in words."""
    return f"{np.round(np.degrees(angle)) + 0.0:.0f}°".replace("-", "−")


OF_BLOCKS = f"Intervals resample blocks of neighbouring pushes ({BLOCK[0]:g} of the side × {in_degrees(BLOCK[1])})."


def redrawn(cells: Sequence[Repetitions], seed: int = 0) -> tuple[Array, Array]:
    """Means and sds (DRAWS, len(cells), 3) of pushes with resampled repetitions."""
    rng, drawn = np.random.default_rng(seed), []
    for cell in cells:
        again = cell.outcomes[rng.integers(0, len(cell.outcomes), (DRAWS, len(cell.outcomes)))]
        drawn.append((again.mean(axis=1), again.std(axis=1, ddof=1)))
    means, sds = zip(*drawn, strict=True)
    return np.stack(means, axis=1), np.stack(sds, axis=1)


def at_places(fractions: Array, angles: Array, maps: Array, places: Sequence[Place]) -> Array:
    """Maps (d, A, C) between their points: (d, len(places)), NaN next to an unknown push."""
    between = RegularGridInterpolator((angles, fractions), np.moveaxis(maps, 0, -1))
    return np.asarray(between([(angle, fraction) for fraction, angle in places])).T


def block_weights(cells: Sequence[Repetitions]) -> Array:
    """Weights (draws, len(cells)): blocks of neighbouring pushes drawn with replacement."""
    contact = [np.floor(cell.fraction / BLOCK[0] + ROUNDING) for cell in cells]
    angle = [np.floor(cell.angle / BLOCK[1] + ROUNDING) for cell in cells]
    return push_bootstrap(np.array([f"{c:.0f}/{a:.0f}" for c, a in zip(contact, angle, strict=True)]))


def by_blocks(figure: Callable[[Array], Array], weights: Array) -> Estimate:
    """A figure of pushes, a function of weights (d, m) that answers (d,), with the interval of those weights."""
    every = figure(np.ones((1, weights.shape[1])))
    return of_draws(float(every[0]), figure(weights))


def mean_of(values: Array, weights: Array) -> Array:
    """Means (d,) of values (m,), weighted by rows of weights (d, m)."""
    return np.asarray(weights @ values / weights.sum(axis=1))


def median_of(values: Array, weights: Array) -> Array:
    """Medians (d,) of values (m,), weighted by rows of integer weights (d, m)."""
    order = np.argsort(values)
    held = np.cumsum(weights[:, order], axis=1)
    half = 0.5 * held[:, -1:]
    return np.asarray(
        0.5 * (values[order][(held >= half).argmax(axis=1)] + values[order][(held > half).argmax(axis=1)])
    )


def unbiased(value: float, draws: Array) -> Estimate:
    """Remove the bias of a figure of noisy maps (a maximum, a range) by a basic bootstrap with draws (d,)."""
    low, high = np.quantile(draws, [0.025, 0.975])
    return Estimate(2.0 * value - float(draws.mean()), 2.0 * value - float(high), 2.0 * value - float(low))


def correlation(one: Array, other: Array, weights: Array) -> Array:
    """Pearson's coefficient (d,) of two maps (m,) for every row of weights (d, m), NaN where one of them is flat."""
    total = weights.sum(axis=1)

    def mean(values: Array) -> Array:
        return np.asarray(weights @ values / total)

    a, b = one - one.mean(), other - other.mean()
    covariance = mean(a * b) - mean(a) * mean(b)
    spread = np.sqrt(np.maximum((mean(a**2) - mean(a) ** 2) * (mean(b**2) - mean(b) ** 2), 0.0))
    flat = spread <= ROUNDING * np.abs(one).max() * np.abs(other).max()
    return np.asarray(np.where(flat, np.nan, covariance / np.where(flat, 1.0, spread)))


@dataclass(frozen=True)
class Peak:
    """The largest value of a map and its place; places: where it falls in 95 % of the draws.

    reach: the value at the named places (mean over them, between the map's points) over the largest.
    """

    value: Estimate
    place: Place
    places: tuple[Place, ...]
    reach: Estimate

    def steps_from(self, named: Sequence[Place]) -> Estimate:
        """Steps of the paper's grid from the nearest of the named places; the interval is over the places."""
        away = [min(max(abs(c - n[0]), abs(a - n[1])) for n in named) / STEP for c, a in (self.place, *self.places)]
        return Estimate(away[0], min(away[1:]), max(away[1:]))


def peak(
    fractions: Array,
    angles: Array,
    shown: Array,
    drawn: Array,
    named: Sequence[Place],
    interval: Callable[[float, Array], Estimate],
) -> Peak:
    """The peak of a map (A, C) with draws (d, A, C), NaN where unknown; named: places of interest."""
    maps = np.concatenate([shown[None], drawn])
    flat = np.where(np.isfinite(maps), maps, -np.inf).reshape(len(maps), -1)
    top, where = flat.max(axis=1), flat.argmax(axis=1)
    reach = at_places(fractions, angles, maps, named).mean(axis=1) / top
    cells = [(float(fractions[i % len(fractions)]), float(angles[i // len(fractions)])) for i in where]
    return Peak(interval(float(top[0]), top[1:]), cells[0], _commonest(cells[1:]), interval(float(reach[0]), reach[1:]))


def _commonest(places: Sequence[Place]) -> tuple[Place, ...]:
    """The fewest places with 95 % of all, the most frequent first."""
    counts = {place: places.count(place) for place in dict.fromkeys(places)}
    ordered = sorted(counts, key=lambda place: -counts[place])
    held = np.cumsum([counts[place] for place in ordered])
    return tuple(ordered[: int(np.searchsorted(held, SURE * len(places) - ROUNDING)) + 1])
