"""Fit yaw, shift and size of the outline, and the clock lag, to the tip's positions in contact.

In contact the tip's centre is one tip radius from the outline. The gap that is left depends on the place of contact if
the outline is turned, shifted or of a wrong size, and on the speed if the clocks are apart. The standard deviations
take each push as one observation: the samples of a push share their errors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import least_squares

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.types import Array, IntArray

Gaps: TypeAlias = Callable[[Array], Array]
MOST_SAMPLES = 1200  # evenly drawn: more change the result by less than its standard deviation
UNKNOWN_SIZE = 0.02  # relative sd
NOISE = 1e-4  # m; a gap beyond this counts linearly, not squared
STARTS = 12  # turns from which the fit begins
WEAK = np.array([1.0, 0.05, 0.05, 0.3, 0.2])  # rad, m, m, 1, s: prior sd, for what the contacts do not determine


@dataclass(frozen=True, eq=False)
class OutlineFit:
    """A correction of the outline in the slider's frame, and its uncertainty.

    estimate (5,) and sd (5,): yaw (rad, counter-clockwise), shift along x and y (m), relative size minus 1, lag of the
    slider's stamps (s). gap: median absolute gap that is left, m; pushes: number of contacts.
    """

    estimate: Array
    sd: Array
    gap: float
    pushes: int


def fit_outline(outline: Outline, radius: float, tips: Array, velocities: Array, push: IntArray) -> OutlineFit:
    """Fit the correction to tips (n, 2; m) with velocities (n, 2; m/s), in the slider's frame, of pushes (n,).

    The size is taken as given where the contacts do not separate it from a shift: all on one side, for example.
    """
    fit = _fit(outline, radius, tips, velocities, push, True)
    return fit if fit.sd[3] < UNKNOWN_SIZE else _fit(outline, radius, tips, velocities, push, False)


def _fit(outline: Outline, radius: float, tips: Array, velocities: Array, push: IntArray, sized: bool) -> OutlineFit:
    rows = np.unique(np.linspace(0, len(tips) - 1, MOST_SAMPLES).astype(np.int64))
    tips, velocities, push = tips[rows], velocities[rows], push[rows]
    turns = outline.rotational_symmetry
    free = np.array([turns != 0, True, True, sized, True])

    def gaps(free_part: Array) -> Array:
        full = np.zeros(5)
        full[free] = free_part
        return gap_after(outline, radius, tips, velocities, full)

    def residuals(free_part: Array) -> Array:
        return np.concatenate([gaps(free_part) / NOISE, free_part / WEAK[free]])

    best = min((_refined(residuals, start[free]) for start in _starts(turns, residuals, free)), key=_cost(gaps))
    part, sd, estimate = best, np.zeros(5), np.zeros(5)
    sd[free], estimate[free] = _deviation(gaps, part, push, WEAK[free]), part
    if turns:
        estimate[0] = wrap_angle(np.asarray(estimate[0] * turns)) / turns
    return OutlineFit(estimate, sd, float(np.median(np.abs(gaps(part)))), len(np.unique(push)))


def gap_after(outline: Outline, radius: float, tips: Array, velocities: Array, correction: Array) -> Array:
    """Gaps (n,) m between tips and the corrected outline."""
    yaw, x, y, growth, lag = correction
    size = 1.0 + max(growth, -0.9)
    own = rotate(tips - lag * velocities - [x, y], -yaw) / size
    return np.asarray(size * outline.project(own).distance - radius)


def _starts(turns: int, residuals: Gaps, free: Array) -> list[Array]:
    """No correction, and the two best of the turns within one period of the symmetry."""
    start = np.zeros((STARTS, 5))
    if not turns:
        return [start[0]]
    start[:, 0] = np.arange(STARTS) * 2.0 * np.pi / turns / STARTS
    start[:, 0] = wrap_angle(start[:, 0] * turns) / turns
    cost = [float(np.sum(np.abs(residuals(row[free])))) for row in start[1:]]
    return [start[0], *start[1:][np.argsort(cost)[:2]]]


def _refined(residuals: Gaps, start: Array) -> Array:
    return np.asarray(least_squares(residuals, start, loss="soft_l1", x_scale=0.01, max_nfev=40).x)


def _cost(gaps: Gaps) -> Callable[[Array], float]:
    return lambda part: float(np.mean(np.minimum(np.abs(gaps(part)), 0.01)))


def _deviation(gaps: Gaps, part: Array, push: IntArray, weak: Array) -> Array:
    """Standard deviations by the sandwich formula with pushes as clusters, and the prior where data are lacking."""
    gap = gaps(part)
    steps = 1e-5 * np.eye(len(part))
    slope = np.column_stack([(gaps(part + step) - gaps(part - step)) / 2e-5 for step in steps])
    weight = 1.0 / np.sqrt(1.0 + (gap / NOISE) ** 2)
    noise = max(float(np.median(np.abs(gap))) * 1.5, 1e-5)
    bread = np.linalg.inv(slope.T @ (weight[:, None] * slope) + np.diag(noise**2 / weak**2))
    scores = [slope[push == one].T @ (weight * gap)[push == one] for one in np.unique(push)]
    meat = np.sum([np.outer(score, score) for score in scores], axis=0)
    few = len(scores) / max(len(scores) - len(part), 1)
    prior = noise**2 * bread @ np.diag(noise**2 / weak**2) @ bread
    return np.asarray(np.sqrt(np.diag(few * bread @ meat @ bread) + np.diag(prior)))
