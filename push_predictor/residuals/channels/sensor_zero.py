# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The zero of the force sensor: its reading in free motion, which the window finder subtracts, against training's.

A bias that is always there is subtracted and does no harm to the windows, but the sensor reads too much by it. The zero
of the new pushes is compared with that of training, and within the session before and after a push. The zero of a sound
sensor also differs a little between sessions (BETWEEN_SESSIONS), which the test takes for chance. Within a session it
may drift by as much. Over hundreds of pushes the means are exact, so this alone bounds the smallest bias that is found:
0.11 N since training and 0.1 N within the session, at a level of 0.001.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.estimate import NORMAL_95
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import NOTHING_FOUND, ChannelEffect, ChannelFinding
from push_predictor.residuals.evidence.drivers import CONSTANT, SENSOR_ZERO, SESSION
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES, push_order
from push_predictor.residuals.outcome import Sized, Tested
from push_predictor.types import Array

BETWEEN_SESSIONS = 0.02  # N, standard deviation of the zero of a sound sensor, per axis
PROGRESS = "push_index"  # along which a step within the session is placed
PLACES = 10  # at which a step is tried
WRENCH_BIAS = "wrench_bias"
BIAS = (("force read too much along x", "N"), ("force read too much along y", "N"))  # its parameters


def zero_shift(windows: PushTable, baseline: PushTable | None, alpha: float = 1.0) -> ChannelFinding:
    """The most significant change of the zero, by chance with probability p_value as large anywhere.

    Its covariate is model_inputs if it is constant since training, push_index for a step within the session.
    Nothing if no push recorded it, or too few. A change since training is tried if the baseline has the zero, too.
    """
    now, before = _zeros(windows), None if baseline is None else _zeros(baseline)
    if now is None:
        return NOTHING_FOUND
    places = np.unique(np.linspace(0, len(now), PLACES + 2).astype(int)[1:-1])
    steps = [_Change(PROGRESS, "step", now[:k], now[k:], 1, 2 * len(places)) for k in places if _enough(now, int(k))]
    tried = steps if before is None else [_Change(CONSTANT, "constant", before, now, 2, 2), *steps]
    if not tried:
        return NOTHING_FOUND
    best = max(tried, key=lambda change: change.log_evidence)
    shown = best if best.basis == "constant" else _placed(best, now)
    effect = ChannelEffect(WRENCH_BIAS, best.covariate, best.basis, shown.parameters(), best.p_value)
    since = Tested(WRENCH_BIAS, SESSION if best.covariate == CONSTANT else best.covariate, best.p_value)
    return ChannelFinding((effect,) if best.p_value <= alpha else (), (since,))


@dataclass(frozen=True, eq=False)
class _Change:
    """A change of the zeros (b, 2) of some pushes to those (a, 2) of later ones.

    sessions: that the pushes are from. alternatives: number of changes tried, of which this is one.
    """

    covariate: str
    basis: str
    before: Array
    after: Array
    sessions: int
    alternatives: int

    @property
    def size(self) -> Array:
        """The change (2,), N."""
        return np.asarray(self.after.mean(axis=0) - self.before.mean(axis=0))

    @property
    def variance(self) -> Array:
        """Covariance (2, 2) of the change by the noise of single pushes."""
        return _of_mean(self.before) + _of_mean(self.after)

    @property
    def log_evidence(self) -> float:
        """Minus the logarithm of the p value: a normal change in two dimensions, Bonferroni."""
        chance = self.variance + self.sessions * BETWEEN_SESSIONS**2 * np.eye(2)
        return float(0.5 * self.size @ np.linalg.solve(chance, self.size) - np.log(self.alternatives))

    @property
    def p_value(self) -> float:
        return float(min(1.0, np.exp(-self.log_evidence)))

    def parameters(self) -> tuple[Sized, ...]:
        """The change along x and y with its interval, N."""
        half = NORMAL_95 * np.sqrt(np.diag(self.variance))
        return tuple(
            Sized(name, float(value), float(value - by), float(value + by), "N")
            for (name, _), value, by in zip(BIAS, self.size, half, strict=True)
        )


def _zeros(table: PushTable) -> Array | None:
    """The zero (p, 2) of each push in order; None if it was not recorded or there are too few pushes."""
    if any(name not in table.covariates for name in SENSOR_ZERO) or len(table.pushes) < FEWEST_PUSHES:
        return None
    first = np.unique(push_order(table), return_index=True)[1]
    zeros = np.column_stack([table.covariates[name][first] for name in SENSOR_ZERO])
    return zeros if np.all(np.isfinite(zeros)) else None


def _enough(zeros: Array, place: int) -> bool:
    return min(place, len(zeros) - place) >= FEWEST_PUSHES


def _placed(step: _Change, zeros: Array) -> _Change:
    """The step at the push between those before and after which the zeros (p, 2) differ most surely."""
    places = (k for k in range(1, len(zeros)) if _enough(zeros, k))
    return max((replace(step, before=zeros[:k], after=zeros[k:]) for k in places), key=lambda each: each.log_evidence)


def _of_mean(zeros: Array) -> Array:
    """Covariance (2, 2) of the mean of zeros (p, 2), from single pushes or from runs of about sqrt(p) pushes.

    A sensor's zero drifts, so that neighbouring pushes may share part of their noise: the larger of the two counts.
    """
    runs = np.array([run.mean(axis=0) for run in np.array_split(zeros, int(np.sqrt(len(zeros))))])
    return np.asarray(max((np.cov(means.T) / len(means) for means in (zeros, runs)), key=np.trace))
