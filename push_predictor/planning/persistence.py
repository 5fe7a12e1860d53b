# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How long prediction errors persist along a push, estimated from the training pushes of a model.

Residuals in the windows of one push are correlated. Friction between slider and table changes only with the distance
travelled, some of it is constant for the whole push, and the learnt function has similar errors in neighbouring
windows. The correlation of standardised residuals over a distance s of the tip is modelled per output as

    persistent + decaying exp(-s / decay_length),     persistent, decaying >= 0,   persistent + decaying <= 1,

and the rest of the variance is independent from window to window. The three parameters are fitted by least squares to
the products of all pairs of windows of a push that are at most LAGS windows apart. For a learnt model the residuals are
leave-one-push-out (models/gaussian_process/ridge.py). They are replaced by their normal scores, because the
few largest would otherwise decide. With few pushes the two fractions are shrunk by pushes / (pushes + FEW) towards
independent windows.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from push_predictor.models.push_model import PushModel
from push_predictor.normal_scores import normal_scores
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray

LAGS = 10  # windows
FEW = 5  # pushes; a correlation from n pushes has a standard error of n^-1/2, and is typically 0.45
LENGTHS = np.geomspace(1e-3, 0.05, 18)  # m, candidates for decay_length


@dataclass(frozen=True, eq=False)
class Persistence:
    """persistent, decaying (3,): fractions of the variance of dx, dy, dtheta; decay_length (3,), m."""

    persistent: Array
    decaying: Array
    decay_length: Array

    def correlation(self, distance: Array) -> Array:
        """Correlation (n, 3) of standardised residuals at a distance (n,) > 0 m along the tip's path."""
        return np.asarray(self.persistent + self.decaying * np.exp(-distance[:, None] / self.decay_length))

    def deviates(self, persistent: Array, decaying: Array, fresh: Array) -> Array:
        """Standard normal deviates (n, 3) of a window from those of its push, of its place, and its own (n, 3 each)."""
        parts = self.persistent, self.decaying, 1.0 - self.persistent - self.decaying
        shares = [np.sqrt(np.maximum(part, 0.0)) for part in parts]
        return np.asarray(shares[0] * persistent + shares[1] * decaying + shares[2] * fresh)

    def decayed(self, decaying: Array, distance: Array, change: Array) -> Array:
        """The decaying deviates (n, 3) at a distance (n,) m along the tip's path; change (n, 3): new deviates."""
        keeps = np.exp(-distance[:, None] / self.decay_length)
        return np.asarray(keeps * decaying + np.sqrt(1.0 - keeps**2) * change)


INDEPENDENT = Persistence(np.zeros(3), np.zeros(3), np.ones(3))


_KNOWN: WeakKeyDictionary[PushModel, Persistence] = WeakKeyDictionary()  # does not keep a model alive


def persistence_of(model: PushModel) -> Persistence:
    """The persistence of a model's training residuals; cached, some tenths of a second for 1000 windows."""
    if model not in _KNOWN:
        _KNOWN[model] = fit_persistence(whitened_residuals(model), model.training)
    return _KNOWN[model]


def fit_persistence(residuals: Array, table: PushTable) -> Persistence:
    """Fit the persistence to residuals (n, 3) of the table's windows; only their ranks matter."""
    first, second, pushes = _pairs(table)
    if pushes == 0:
        return INDEPENDENT
    apart = _distance_between(table, first, second)
    scores = normal_scores(residuals)
    products = scores[first] * scores[second] / np.maximum(np.mean(scores**2, axis=0), np.finfo(float).tiny)
    shares = [_fit(apart, column) for column in products.T]
    persistent, decaying, decay_length = np.array(shares).T
    trust = pushes / (pushes + FEW)
    return Persistence(trust * persistent, trust * decaying, decay_length)


def whitened_residuals(model: PushModel) -> Array:
    """Leave-one-push-out residuals (n, 3) of the training rows, whitened by the predicted covariance."""
    rows = model.training
    mean, covariance, _ = model.held_out_moments()
    # A covariance without noise has no inverse.
    return np.asarray((np.linalg.pinv(root_of(covariance)) @ (rows.outcomes - mean)[:, :, None])[:, :, 0])


def root_of(covariance: Array) -> Array:
    """Roots R (n, 3, 3) of covariances (n, 3, 3) with R R' = covariance, independent of the outputs' units.

    R is the standard deviations times the symmetric root U of the correlation C. With the invariants i of U,
    (i1 i2 - i3) U = (i1^2 - i2) C - C^2 + i1 i3 I. Source: Hoger and Carlson, Quart. Appl. Math. 42, 1984.
    """
    sd = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    above = np.maximum(sd, np.sqrt(np.finfo(float).tiny))
    correlation = covariance / (above[:, :, None] * above[:, None, :])
    one, two, three = np.sqrt(_eigenvalues(*correlation[:, [0, 0, 1], [1, 2, 2]].T))
    first, second = one + two + three, one * two + one * three + two * three
    of_correlation, of_identity = (first**2 - second)[:, None, None], (first * one * two * three)[:, None, None]
    scaled = of_correlation * correlation - correlation @ correlation + of_identity * np.eye(3)
    return np.asarray((sd / ((one + two) * (one + three) * (two + three))[:, None])[:, :, None] * scaled)


def _eigenvalues(r12: Array, r13: Array, r23: Array) -> Array:
    """Eigenvalues (3, n) of correlation matrices. Source: Smith, Communications of the ACM 4, 1961.

    None is below the rounding error, so that a singular matrix has a root too, accurate to 1e-5.
    """
    size = np.sqrt((r12**2 + r13**2 + r23**2) / 3.0)
    cosine = r12 * r13 * r23 / np.maximum(size**3, np.finfo(float).tiny)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0)) / 3.0 + np.array([[0.0], [2.0], [4.0]]) * np.pi / 3.0
    return np.asarray(np.maximum(1.0 + 2.0 * size * np.cos(angle), np.finfo(float).eps))


def _distance_between(table: PushTable, first: IntArray, second: IntArray) -> Array:
    """Distance (k,) in m along the tip's path between windows; they are contiguous unless their times are known."""
    if "elapsed_time" in table.covariates:
        later = table.covariates["elapsed_time"][second] - table.covariates["elapsed_time"][first]
        return np.asarray(np.abs(later) * 0.5 * (table.inputs[first, 0] + table.inputs[second, 0]))
    driven = np.cumsum(table.inputs[:, 0] * table.duration)
    return np.asarray(driven[second] - driven[first])


def _pairs(table: PushTable) -> tuple[IntArray, IntArray, int]:
    """Rows of the earlier and the later window (k,) of all pairs within a push, and the number of these pushes."""
    number = np.unique(table.push_id, return_inverse=True)[1]
    order = np.lexsort((table.covariates.get("elapsed_time", np.arange(len(table))), number))
    number = number[order]
    lags = [np.flatnonzero(number[:-lag] == number[lag:]) for lag in range(1, min(LAGS, len(number) - 1) + 1)]
    first = np.concatenate([np.empty(0, dtype=np.int64), *lags])
    second = np.concatenate([np.empty(0, dtype=np.int64), *(rows + lag for lag, rows in enumerate(lags, 1))])
    return order[first], order[second], len(np.unique(number[first]))


def _fit(apart: Array, products: Array) -> tuple[float, float, float]:
    """Persistent and decaying fraction and decay length with the least squared error to products (k,)."""
    from scipy.optimize import nnls  # its import would take every predict_server 0.2 s at the start

    fits = []
    for length in LENGTHS.tolist():
        decay = np.exp(-apart / length)
        persistent, decaying = nnls(np.column_stack([np.ones(len(apart)), decay]), products)[0]
        if persistent + decaying > 1.0:  # then no part is independent from window to window
            persistent = float(np.clip((products - decay) @ (1.0 - decay) / np.sum((1.0 - decay) ** 2), 0.0, 1.0))
            decaying = 1.0 - persistent
        fits.append((float(np.sum((products - persistent - decaying * decay) ** 2)), persistent, decaying, length))
    return min(fits)[1:]
