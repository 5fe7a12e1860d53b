# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Fit yaw, shift and size of the outline, the clock lag and the tip's radius to the tip's positions in contact.

In contact the tip's centre is one tip radius from the outline. The gap that is left depends on the place of contact if
the outline is turned, shifted or of a wrong size, on the speed if the clocks are apart, and on the slider's heading and
place if the world frames of tracker and robot are apart. The standard deviations take each push as one observation: the
samples of a push share their errors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.optimize import least_squares

from push_predictor.geometry.frames import to_world, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import near_symmetry, transformed
from push_predictor.recordings.checks.outline.touches import (
    FRAME_X,
    FRAME_Y,
    FRAME_YAW,
    LAG,
    SIZE,
    TIP,
    YAW,
    Contacts,
    Touches,
    X,
    Y,
)
from push_predictor.types import Array, BoolArray, IntArray

Gaps: TypeAlias = Callable[[Array], Array]
SIMILARITY = (YAW, X, Y, SIZE, LAG)
FRAMES = (FRAME_YAW, FRAME_X, FRAME_Y)
MOST_SAMPLES = 1200  # evenly drawn: more change the result by less than its standard deviation
UNKNOWN_SIZE = 0.02  # relative sd
NOISE = 1e-4  # m; a gap beyond this counts linearly, not squared
LARGEST = 0.01  # m; a larger gap counts as this much in the cost
CORNER = 0.003  # m
SHORT = 0.3  # of the median number of samples
DISTURBED = 0.001  # m; the spread from which on world frames are sought that are far apart
MOST_EVALUATIONS = 40  # of the gaps by a fit
SMALLEST_GAIN = 1e-4  # relative change of the cost at which a fit ends: it moves the estimate by a fraction of its sd
STARTS = 12  # turns from which the fit begins
# Prior sd of what the contacts do not determine, in the units of OutlineFit.
WEAK = np.array([1.0, 0.05, 0.05, 0.3, 0.2, 0.02, 1.0, 0.05, 0.05, 0.3])
TIE = 1.3  # ratio of the gaps up to which the smallest turn is preferred: an almost symmetric outline has several
MOST_PUSHES = 0.8  # share of the pushes that lie within `spread`: a push in five may be disturbed


@dataclass(frozen=True, eq=False)
class OutlineFit:
    """A correction of the outline in the slider's frame, and its uncertainty.

    estimate (10,) and sd (10,): yaw (rad, counter-clockwise, about the centroid), shift along x and y (m), relative
    size minus 1, lag of the slider's stamps (s), correction of the tip's radius (m); turn (rad, about `centre`) and
    shift (m, m) that bring the tip from the pusher's world frame to the slider's; relative length along the outline's x
    minus that along its y. estimate and sd are 0 where a parameter was not fitted.

    gap: median absolute gap that is left, m; cost: its mean, m; push_gaps (pushes,): the median of each push, m,
    signed, push_contacts (pushes,) where it is on the outline, push_samples (pushes,) of how many samples. centre (2,):
    mean place of the tip, m, world frame.
    """

    estimate: Array
    sd: Array
    gap: float
    cost: float
    push_gaps: Array
    push_contacts: Array
    push_samples: IntArray
    centre: Array

    @property
    def pushes(self) -> int:
        """Number of contacts."""
        return len(self.push_gaps)

    def off(self, outline: Outline, allowance: float) -> BoolArray:
        """Which pushes (pushes,) have a larger gap (m).

        Not those at corners, which are rounded, nor short ones: a jump of the slider's pose may look like a contact.
        """
        judged = _away_from_corners(outline, self.push_contacts) >= CORNER
        judged &= self.push_samples >= SHORT * np.median(self.push_samples)
        return np.asarray((np.abs(self.push_gaps) > allowance) & judged)

    @property
    def spread(self) -> float:
        """The gap (m) that all pushes but one in five keep below: what the correction leaves unexplained."""
        return float(np.quantile(np.abs(self.push_gaps), MOST_PUSHES))


def fit_outline(outline: Outline, radius: float, contacts: Contacts) -> OutlineFit:
    """Fit the correction to the contacts of a tip (radius in m), with the radius as given.

    The size is taken as given too where the contacts do not separate it from a shift: all on one side, for example.
    """
    fit = _fit(outline, radius, contacts, SIMILARITY, _starts)
    if fit.sd[SIZE] < UNKNOWN_SIZE:
        return fit
    return _fit(outline, radius, contacts, [each for each in SIMILARITY if each != SIZE], _starts)


def fit_outline_and(
    further: Sequence[int], outline: Outline, radius: float, contacts: Contacts, first: OutlineFit
) -> OutlineFit:
    """Fit the correction with further parameters, from the fit without them. Large sd show what is not separable.

    With the tip's radius, contacts at corners are dropped: real corners are rounded, and would decide.
    """
    free = [*_fitted(first), *further]
    return _fit(outline, radius, _chosen(outline, contacts, first, free), free, lambda *_: [first.estimate])


def fit_tip(outline: Outline, radius: float, contacts: Contacts, first: OutlineFit) -> OutlineFit:
    """Fit the tip's radius in place of the size, which is taken as given."""
    free = [*(each for each in _fitted(first) if each != SIZE), TIP]
    return _fit(outline, radius, _chosen(outline, contacts, first, free), free, lambda *_: [first.estimate])


def fit_frames(outline: Outline, radius: float, contacts: Contacts, first: OutlineFit) -> OutlineFit:
    """Fit turn and shift between the world frames of slider and pusher too, from the first fit and from afar."""
    free = [*_fitted(first), *FRAMES]
    apart = contacts.poses[:, :2].mean(axis=0) - to_world(contacts.tips, contacts.poses).mean(axis=0)
    far = first.spread > DISTURBED

    def starts(_: int, residuals: Gaps) -> list[Array]:
        return [first.estimate, *(_frame_starts(apart, residuals) if far else [])]

    return _fit(outline, radius, contacts, free, starts)


def _fitted(fit: OutlineFit) -> list[int]:
    return [int(each) for each in np.flatnonzero(fit.sd)]


def _frame_starts(apart: Array, residuals: Gaps) -> list[Array]:
    """The two best of the turns between the world frames, with a shift (2,) m that brings tip and slider together."""
    start = np.zeros((STARTS, len(WEAK)))
    start[:, FRAME_YAW], start[:, [FRAME_X, FRAME_Y]] = wrap_angle(np.arange(STARTS) * 2.0 * np.pi / STARTS), apart
    cost = [float(np.sum(np.abs(residuals(row)))) for row in start]
    return list(start[np.argsort(cost)[:2]])


def _chosen(outline: Outline, contacts: Contacts, first: OutlineFit, free: Sequence[int]) -> Contacts:
    """All contacts, or those away from corners if the tip's radius is fitted."""
    if TIP not in free or not (sides := ~_at_corner(outline, contacts, first)).any():
        return contacts
    return contacts.at(sides)


def _at_corner(outline: Outline, contacts: Contacts, fit: OutlineFit) -> BoolArray:
    """Which contacts (n,) are near a corner of the corrected outline."""
    yaw, x, y, growth, lag = fit.estimate[list(SIMILARITY)].tolist()
    corrected = transformed(outline, yaw, (x, y), 1.0 + growth)
    contact = corrected.project(contacts.tips - lag * contacts.velocities).contact
    return np.asarray(_away_from_corners(corrected, contact) < CORNER)


def _away_from_corners(outline: Outline, contact: Array) -> Array:
    """Distances (n,) m along the outline from the nearest corner; infinity on a smooth one."""
    if outline.semi_axes is not None:
        return np.full(len(contact), np.inf)
    return np.asarray(np.abs(contact[:, None] - outline.edge_starts).min(axis=1) * outline.perimeter)


def _fit(
    outline: Outline,
    radius: float,
    contacts: Contacts,
    parameters: Sequence[int],
    starts: Callable[[int, Gaps], list[Array]],
) -> OutlineFit:
    middle = outline.centroid  # a turn about it shifts nothing, so that both are known as well as they can be
    centred = transformed(outline, shift=(-middle[0], -middle[1]))
    touches = Touches(_drawn(contacts), centred, radius, middle)
    free = np.isin(np.arange(len(WEAK)), parameters)
    free[YAW] &= centred.rotational_symmetry != 0
    problem = _Problem(touches, free)
    tried = starts(near_symmetry(centred), lambda full: problem.residuals(full[free]))
    part = _best(problem, [start[free] for start in tried])
    estimate, sd = _full(free, part), _full(free, _deviation(problem, part))
    gaps = touches.gaps(estimate)
    push_gaps, places = _by_push(touches.push, gaps, touches.placed(estimate).nearest.contact)
    if turns := centred.rotational_symmetry:
        estimate[YAW] = wrap_angle(np.asarray(estimate[YAW] * turns)) / turns
    samples = np.unique(touches.push, return_counts=True)[1]
    gap, cost = float(np.median(np.abs(gaps))), _cost(problem.gaps, part)
    return OutlineFit(estimate, sd, gap, cost, push_gaps, places, samples, touches.centre)


def _drawn(contacts: Contacts) -> Contacts:
    """Evenly drawn contacts, at most MOST_SAMPLES."""
    return contacts.at(np.unique(np.linspace(0, len(contacts.tips) - 1, MOST_SAMPLES).astype(np.int64)))


@dataclass(frozen=True, eq=False)
class _Problem:
    """Gaps (n,) m by the free parameters, part (p,); the residuals are gaps and parameters in units of their scale."""

    touches: Touches
    free: BoolArray

    def gaps(self, part: Array) -> Array:
        return self.touches.gaps(_full(self.free, part))

    def slopes(self, part: Array) -> Array:
        """Derivatives (n, p) of the gaps."""
        return self.touches.slopes(_full(self.free, part))[:, self.free]

    def residuals(self, part: Array) -> Array:
        return np.concatenate([self.gaps(part) / NOISE, part / WEAK[self.free]])

    def jacobian(self, part: Array) -> Array:
        """Derivatives (n + p, p) of the residuals."""
        return np.vstack([self.slopes(part) / NOISE, np.diag(1.0 / WEAK[self.free])])


def _full(free: BoolArray, part: Array) -> Array:
    full = np.zeros(len(free))
    full[free] = part
    return full


def _by_push(push: IntArray, gap: Array, contact: Array) -> tuple[Array, Array]:
    """The median gap of each push, and the contact of the sample that has it."""
    rows = [np.flatnonzero(push == one) for one in np.unique(push)]
    middle = [each[np.argsort(gap[each])[len(each) // 2]] for each in rows]
    return gap[middle], contact[middle]


def _best(problem: _Problem, starts: Sequence[Array]) -> Array:
    """The fit from the first start, unless another leaves a clearly smaller gap; the first has no correction.

    Below the noise of a tracker none is clearly smaller, and the others are not tried.
    """
    parts = [_refined(problem, starts[0])]
    if _cost(problem.gaps, parts[0]) <= NOISE:
        return parts[0]
    parts += [_refined(problem, start) for start in starts[1:]]
    costs = [_cost(problem.gaps, part) for part in parts]
    return parts[0] if costs[0] <= TIE * min(costs) else parts[int(np.argmin(costs))]


def _starts(turns: int, residuals: Gaps) -> list[Array]:
    """No correction, and the two best of the turns within one period of the symmetry, exact or almost."""
    start = np.zeros((STARTS, len(WEAK)))
    if not turns:
        return [start[0]]
    start[:, YAW] = np.arange(STARTS) * 2.0 * np.pi / turns / STARTS
    start[:, YAW] = wrap_angle(start[:, YAW] * turns) / turns
    cost = [float(np.sum(np.abs(residuals(row)))) for row in start[1:]]
    return [start[0], *start[1:][np.argsort(cost)[:2]]]


def _refined(problem: _Problem, start: Array) -> Array:
    found = least_squares(
        problem.residuals,
        start,
        jac=problem.jacobian,
        loss="soft_l1",
        x_scale="jac",
        ftol=SMALLEST_GAIN,
        max_nfev=MOST_EVALUATIONS,
    )
    return np.asarray(found.x)


def _cost(gaps: Gaps, part: Array) -> float:
    return float(np.mean(np.minimum(np.abs(gaps(part)), LARGEST)))


def _deviation(problem: _Problem, part: Array) -> Array:
    """Standard deviations by the sandwich formula with pushes as clusters, and the prior where data are lacking."""
    gap, slope, push, weak = problem.gaps(part), problem.slopes(part), problem.touches.push, WEAK[problem.free]
    weight = 1.0 / np.sqrt(1.0 + (gap / NOISE) ** 2)
    noise = max(float(np.median(np.abs(gap))) * 1.5, 1e-5)
    bread = np.linalg.inv(slope.T @ (weight[:, None] * slope) + np.diag(noise**2 / weak**2))
    scores = [slope[push == one].T @ (weight * gap)[push == one] for one in np.unique(push)]
    meat = np.sum([np.outer(score, score) for score in scores], axis=0)
    few = len(scores) / max(len(scores) - len(part), 1)
    prior = noise**2 * bread @ np.diag(noise**2 / weak**2) @ bread
    return np.asarray(np.sqrt(np.diag(few * bread @ meat @ bread) + np.diag(prior)))
