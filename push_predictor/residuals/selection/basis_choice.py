# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The basis of the dependence on a covariate: the simplest within one standard error of the best, cross-validated.

Tried are linear, logarithmic, a step with its place, quadratic, a map over the table, and periodic for headings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from push_predictor.models.effects.covariate_range import HEADINGS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.drivers import CATEGORIES, PLACE, standard_basis, two_dimensional
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.selection.cross_validation import HeldOutGains, Judged
from push_predictor.types import Array, IntArray

MOST_PLACES = 60  # that are tried near the best of these
SAME_GAIN = 1e-9  # relative difference of gains that is rounding
STEPS = 9  # places of a step that are tried, at quantiles of the covariate
SIMPLEST_FIRST = ("constant", "category", "linear", "logarithmic", "step", "periodic", "periodic, twice around",
                  "quadratic", "map")  # fmt: skip


def simplest_basis(candidate: Candidate, table: PushTable, z: Array, controls: Array, block: IntArray) -> Judged:
    """The candidate in the simplest basis whose gain is within one standard error of the best.

    A step is then moved to the place between two windows, near the one that was tried, where it gains most.
    """
    residualizer = Residualizer(controls)
    gains = HeldOutGains.of(residualizer(z), block)

    def judged(basis: DriverBasis) -> Judged:
        tried = with_basis(candidate, basis, table)
        return Judged(tried, gains.of_columns(residualizer(tried.columns)))

    chosen = simplest([judged(basis) for basis in bases_for(candidate, table)])
    return _moved(chosen, table.covariates[candidate.covariate], judged) if _is_step(chosen) else chosen


def best_onset(candidate: Candidate, table: PushTable, z: Array, block: IntArray) -> Judged:
    """The candidate as an effect that begins within these pushes, in the basis that gains most.

    It sets in at once between two windows, or grows from zero at the start, linearly or ever more slowly. All are the
    same for a covariate with two values: it is then a step.
    """
    name = candidate.covariate
    values = table.covariates[name]
    growing = [standard_basis(kind, name, values) for kind in ("linear", "logarithmic")]
    growing[0] = replace(growing[0], centre=(float(values.min()),))
    gains = HeldOutGains.of(z, block)

    def judged(basis: DriverBasis) -> Judged:
        tried = with_basis(candidate, basis, table)
        return Judged(tried, gains.of_columns(tried.columns))

    steps = [judged(DriverBasis("step", (name,), place=place)) for place in step_places(values)]
    step = _moved(max(steps, key=_gain), values, judged)
    grown = max(map(judged, growing), key=_gain)
    return grown if grown.gain - step.gain > SAME_GAIN * abs(step.gain) else step


def bases_for(candidate: Candidate, table: PushTable) -> list[DriverBasis]:
    """The bases in which a candidate's covariate may enter."""
    name, basis = candidate.covariate, candidate.basis
    if basis.is_constant or name in CATEGORIES:
        return [basis]
    if name in HEADINGS:
        return [DriverBasis("periodic", (name,)), DriverBasis("periodic, twice around", (name,))]
    values = table.covariates[name]
    bases = [standard_basis(kind, name, values) for kind in ("linear", "logarithmic", "quadratic")]
    if candidate.grows:
        bases[0] = replace(bases[0], centre=(float(values.min()),))
    bases += [DriverBasis("step", (name,), place=place) for place in step_places(values)]
    if name in PLACE and all(p in table.covariates for p in PLACE):
        bases.append(two_dimensional(table))
    return bases


def simplest(tried: list[Judged]) -> Judged:
    """The simplest whose gain is less than one standard error of the difference below the best; ties by gain."""
    best = max(tried, key=lambda j: j.gain)
    near = [j for j in tried if best.gain - j.gain <= _error(best.gains - j.gains)]
    return min(near, key=lambda j: (SIMPLEST_FIRST.index(j.candidate.basis.name), -j.gain))


def with_basis(candidate: Candidate, basis: DriverBasis, table: PushTable) -> Candidate:
    """The candidate in another basis."""
    return replace(candidate, basis=basis, values=basis.values(table.covariates, len(table)))


def step_places(values: Array) -> list[float]:
    """Places that are tried first: midpoints between the values at even quantiles and the values before them."""
    ordered = np.unique(values)
    if len(ordered) < 2:
        return []
    marks = np.quantile(values, np.arange(1, STEPS + 1) / (STEPS + 1.0))
    index = np.unique(np.clip(np.searchsorted(ordered, marks), 1, len(ordered) - 1))
    return [float(0.5 * (ordered[k - 1] + ordered[k])) for k in index]


def _is_step(judged: Judged) -> bool:
    return judged.candidate.basis.name == "step"


def _moved(step: Judged, values: Array, judged: Callable[[DriverBasis], Judged]) -> Judged:
    """The step at the place near its own where it gains most."""
    near = step_places_near(values, step.candidate.basis.place)
    return max([step, *(judged(replace(step.candidate.basis, place=place)) for place in near)], key=_gain)


def step_places_near(values: Array, place: float, most: int = MOST_PLACES) -> list[float]:
    """Midpoints between neighbouring values, from the next place that was tried below to the next above."""
    ordered, tried = np.unique(values), step_places(values)
    low = max((other for other in tried if other < place), default=-np.inf)
    high = min((other for other in tried if other > place), default=np.inf)
    middle = 0.5 * (ordered[1:] + ordered[:-1])
    inside = middle[(middle > low) & (middle < high)]
    return [float(middle) for middle in inside[:: max(1, len(inside) // most)]]


def _gain(judged: Judged) -> float:
    return judged.gain


def _error(differences: Array) -> float:
    return float(np.sqrt(len(differences)) * differences.std())
