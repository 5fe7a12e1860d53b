"""Which of the significant candidates explains best, and which of its rivals these data cannot tell from it.

Judged by push-blocked cross-validation: fitted on some blocks of pushes, the gain in log density on the others.
Coefficients are shrunk by the factor of James and Stein 1961, with their variance robust to dependence within blocks:
without it a candidate of many columns, as the generic ones are, would lose by its noise to a wrong one of few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.residuals.candidates.enumeration import Candidate
from push_predictor.residuals.evidence.residualizer import Residualizer, sums_by
from push_predictor.residuals.selection.screening import TINY
from push_predictor.types import Array, BoolArray, IntArray

FOLDS = 5
RIDGE = 1e-3  # share of a column's own square, for columns that nearly coincide


@dataclass(frozen=True, eq=False)
class Judged:
    """A candidate with its gain (blocks,) in nats, block by block, out of sample."""

    candidate: Candidate
    gains: Array

    @property
    def gain(self) -> float:
        """Sum of the gains, nats."""
        return float(self.gains.sum())


def judge(candidates: Sequence[Candidate], z: Array, basis: Array, block: IntArray) -> list[Judged]:
    """Judge candidates on residuals z (n, 3), best first; the basis (n, m) of the inputs goes out of both."""
    out = Residualizer(basis)
    left = out(z)
    judged = [Judged(c, gains_of(left, out(c.columns), block)) for c in candidates]
    return sorted(judged, key=lambda j: -j.gain)


def folds_of(block: IntArray) -> IntArray:
    """Fold (n,) of every window; the blocks are dealt in turn, so that every fold spans the whole time."""
    return block % FOLDS


def fit(flat: Array, left: Array, block: IntArray | None = None) -> Array:
    """Coefficients (p,) of columns (n, 3, p) for residuals (n, 3) by least squares; shrunk where blocks are given."""
    numbers = np.arange(len(left)) if block is None else block
    x = flat.reshape(-1, flat.shape[2])
    scores, information = sums_by(numbers, np.einsum("nkp,nk->np", flat, left)), x.T @ x
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * max(values[-1], np.finfo(float).tiny)
    root = vectors[:, keep] / np.sqrt(values[keep])
    each = scores @ root
    estimate = each.sum(axis=0)
    return np.asarray(root @ (estimate * (1.0 if block is None else _james_stein(estimate, each))))


def gains_of(left: Array, flat: Array, block: IntArray) -> Array:
    """Gain per block: log density of the residuals after less before, each output with its own variance."""
    gains = np.zeros(len(left))
    folds = folds_of(block)
    for fold in range(FOLDS):
        test = folds == fold
        if test.any() and not test.all():
            gains[test] = _gain(left, flat, block, test)
    return sums_by(block, gains[:, None])[:, 0]


def _gain(left: Array, flat: Array, block: IntArray, test: BoolArray) -> Array:
    rest = ~test
    after = left - flat @ fit(flat[rest], left[rest], block[rest])
    old, new = (np.mean(r[rest] ** 2, axis=0) for r in (left, after))
    return _log_density(after[test], new) - _log_density(left[test], old)


def _james_stein(estimate: Array, each: Array) -> float:
    """1 - noise / (noise + signal), with the noise from the scatter of the blocks' scores about their mean."""
    size = float(estimate @ estimate)
    noise = float(np.sum((each - each.mean(axis=0)) ** 2))
    return max(0.0, 1.0 - noise / size) if size > 0.0 else 0.0


def _log_density(residuals: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * np.sum(np.log(variance) + residuals**2 / variance, axis=1))
