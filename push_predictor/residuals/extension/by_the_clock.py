# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Steps in the elapsed time: nobody needs to have counted pushes and metres to know that they are past."""

from __future__ import annotations

from dataclasses import replace

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.drivers import COUNT, DISTANCE, TIME
from push_predictor.residuals.selection.search import Term


def by_the_clock(term: Term, table: PushTable) -> Candidate:
    """The candidate of a term; a step of count or distance that time explains as well is the same step of time.

    An effect that grows keeps its covariate: a pause, in which time goes on alone, must not let it grow.
    """
    best = term.best
    if best.basis.name != "step" or best.covariate not in (COUNT, DISTANCE) or TIME not in term.naming.covariates:
        return best
    elapsed, after = table.covariates[TIME], best.basis.values(table.covariates, len(table))[:, 0] > 0.0
    before, since = float(elapsed[~after].max()), float(elapsed[after].min())
    if before >= since:
        return best
    step = DriverBasis("step", (TIME,), place=0.5 * (before + since))
    return replace(best, covariate=TIME, basis=step)  # with the same values


def along(named: Candidate, effect: Effect) -> Effect:
    """The effect along the covariate of the candidate that it was named after, which has the same values."""
    return replace(effect, covariate=named.covariate, basis=named.basis)
