# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forms in which an effect may depend on a covariate, all of them of the whole effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.effects.covariates import CUMULATIVE, HEADINGS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.drivers import CATEGORIES, PLACE, standard_basis, two_dimensional
from push_predictor.types import Array

STEPS = 9  # places of a step that are tried first, at quantiles of the covariate
MOST_PLACES = 60  # that are tried near the best of these
SOON = 0.03  # of the covariate's range: scale of an effect that grows early in it


def forms_of(covariate: str, table: PushTable) -> list[DriverBasis]:
    """Growing from zero at the start, a step at an onset, any line or curve; of a heading periodic; simplest first."""
    if float(np.ptp(table.covariates[covariate])) == 0.0:  # in the windows of a fit, though not in all
        return [DriverBasis("constant")]
    if covariate in CATEGORIES:
        levels = tuple(float(level) for level in np.unique(table.covariates[covariate]))
        return [DriverBasis("category", (covariate,), levels=levels, offset=True)]
    if covariate in HEADINGS:
        return [DriverBasis(name, (covariate,), offset=True) for name in ("periodic", "periodic, twice around")]
    values = table.covariates[covariate]
    linear, logarithmic, quadratic = (
        standard_basis(n, covariate, values) for n in ("linear", "logarithmic", "quadratic")
    )
    forms = [replace(linear, centre=(float(values.min()),)), logarithmic]
    if covariate in CUMULATIVE:
        forms.append(replace(logarithmic, scale=(SOON * float(np.ptp(values)),)))
    forms += [DriverBasis("step", (covariate,), place=place) for place in step_places(values)]
    forms.append(replace(linear, offset=True))
    if covariate in CUMULATIVE:
        return forms
    forms += [linear, replace(quadratic, offset=True)]
    if covariate in PLACE and all(name in table.covariates for name in PLACE):
        forms.append(replace(two_dimensional(table), offset=True))
    return forms


def step_places(values: Array) -> list[float]:
    """Places that are tried first: midpoints between the values at even quantiles and the values before them."""
    ordered = np.unique(values)
    if len(ordered) < 2:
        return []
    marks = np.quantile(values, np.arange(1, STEPS + 1) / (STEPS + 1.0))
    index = np.unique(np.clip(np.searchsorted(ordered, marks), 1, len(ordered) - 1))
    return [float(0.5 * (ordered[k - 1] + ordered[k])) for k in index]


def step_places_near(values: Array, place: float, most: int = MOST_PLACES) -> list[float]:
    """Midpoints between neighbouring values, from the next place that was tried below to the next above."""
    ordered, tried = np.unique(values), step_places(values)
    low = max((other for other in tried if other < place), default=-np.inf)
    high = min((other for other in tried if other > place), default=np.inf)
    middle = 0.5 * (ordered[1:] + ordered[:-1])
    inside = middle[(middle > low) & (middle < high)]
    return [float(middle) for middle in inside[:: max(1, -(-len(inside) // most))]]
