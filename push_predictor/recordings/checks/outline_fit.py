# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Fit yaw, shift and size of the outline, the clock lag and the tip's radius to the tip's positions in contact.

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
from push_predictor.geometry.shapes import transformed
from push_predictor.types import Array, BoolArray, IntArray

Gaps: TypeAlias = Callable[[Array], Array]
MOST_SAMPLES = 1200  # evenly drawn: more change the result by less than its standard deviation
UNKNOWN_SIZE = 0.02  # relative sd
NOISE = 1e-4  # m; a gap beyond this counts linearly, not squared
CORNER = 0.003  # m
STARTS = 12  # turns from which the fit begins
WEAK = np.array([1.0, 0.05, 0.05, 0.3, 0.2, 0.02])  # rad, m, m, 1, s, m: prior sd of what the contacts do not determine
TIE = 1.3  # ratio of the gaps up to which the smallest turn is preferred: an almost symmetric outline has several


@dataclass(frozen=True, eq=False)
class Contacts:
    """n samples in contact, in the slider's frame: tips (n, 2) m, velocities (n, 2) m/s, number of the push (n,)."""

    tips: Array
    velocities: Array
    push: IntArray


@dataclass(frozen=True, eq=False)
class OutlineFit:
    """A correction of the outline in the slider's frame, and its uncertainty.

    estimate (6,) and sd (6,): yaw (rad, counter-clockwise, about the centroid), shift along x and y (m), relative size
    minus 1, lag of the slider's stamps (s), correction of the tip's radius (m); estimate and sd are 0 where a parameter
    was not fitted. gap: median absolute gap that is left, m; pushes: number of contacts.
    """

    estimate: Array
    sd: Array
    gap: float
    pushes: int


def fit_outline(outline: Outline, radius: float, contacts: Contacts) -> OutlineFit:
    """Fit the correction to the contacts of a tip (radius in m), with the radius as given.

    The size is taken as given too where the contacts do not separate it from a shift: all on one side, for example.
    """
    fit = _fit(outline, radius, contacts, sized=True, tip=False)
    return fit if fit.sd[3] < UNKNOWN_SIZE else _fit(outline, radius, contacts, sized=False, tip=False)


def fit_outline_and_tip(outline: Outline, radius: float, contacts: Contacts, first: OutlineFit) -> OutlineFit:
    """Fit the correction with both size and tip radius. Large sd show that the contacts do not separate the two.

    first: the fit without the radius. Contacts at corners are left out: real corners are rounded, and would decide.
    """
    sides = ~_at_corner(outline, contacts, first)
    chosen = Contacts(contacts.tips[sides], contacts.velocities[sides], contacts.push[sides])
    return _fit(outline, radius, chosen if sides.any() else contacts, sized=True, tip=True)


def _at_corner(outline: Outline, contacts: Contacts, fit: OutlineFit) -> BoolArray:
    """Which contacts (n,) are near a corner of the corrected outline."""
    if outline.semi_axes is not None:
        return np.zeros(len(contacts.tips), dtype=np.bool_)
    yaw, x, y, growth, lag, _ = fit.estimate
    corrected = transformed(outline, yaw, (x, y), 1.0 + growth)
    contact = corrected.project(contacts.tips - lag * contacts.velocities).contact
    away = np.abs(contact[:, None] - corrected.edge_starts).min(axis=1) * corrected.perimeter
    return np.asarray(away < CORNER)


def _fit(outline: Outline, radius: float, contacts: Contacts, sized: bool, tip: bool) -> OutlineFit:
    rows = np.unique(np.linspace(0, len(contacts.tips) - 1, MOST_SAMPLES).astype(np.int64))
    centre = outline.centroid  # a turn about it shifts nothing, so that both are known as well as they can be
    centred = transformed(outline, shift=(-centre[0], -centre[1]))
    tips, velocities, push = contacts.tips[rows] - centre, contacts.velocities[rows], contacts.push[rows]
    turns = centred.rotational_symmetry
    free = np.array([turns != 0, True, True, sized, True, tip])

    def gaps(free_part: Array) -> Array:
        full = np.zeros(6)
        full[free] = free_part
        return gap_after(centred, radius, tips, velocities, full)

    def residuals(free_part: Array) -> Array:
        return np.concatenate([gaps(free_part) / NOISE, free_part / WEAK[free]])

    part = _best([_refined(residuals, start[free]) for start in _starts(turns, residuals, free)], gaps)
    sd, estimate = np.zeros(6), np.zeros(6)
    sd[free], estimate[free] = _deviation(gaps, part, push, WEAK[free]), part
    if turns:
        estimate[0] = wrap_angle(np.asarray(estimate[0] * turns)) / turns
    return OutlineFit(estimate, sd, float(np.median(np.abs(gaps(part)))), len(np.unique(push)))


def gap_after(outline: Outline, radius: float, tips: Array, velocities: Array, correction: Array) -> Array:
    """Gaps (n,) m between tips and the corrected outline, whose centroid is the origin; correction as in OutlineFit."""
    yaw, x, y, growth, lag, thicker = correction
    size = 1.0 + max(growth, -0.9)
    own = rotate(tips - lag * velocities - [x, y], -yaw) / size
    return np.asarray(size * outline.project(own).distance - radius - thicker)


def _best(parts: list[Array], gaps: Gaps) -> Array:
    """The first, unless another leaves a clearly smaller gap; the first begins without a correction."""
    costs = [_cost(gaps)(part) for part in parts]
    return parts[0] if costs[0] <= TIE * min(costs) else parts[int(np.argmin(costs))]


def _starts(turns: int, residuals: Gaps, free: Array) -> list[Array]:
    """No correction, and the two best of the turns within one period of the symmetry."""
    start = np.zeros((STARTS, 6))
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
