"""Cross-validated gain of candidates: fitted on some blocks of pushes, the gain in log density on the others.

Coefficients are shrunk by the factor of James and Stein 1961, with a variance that is robust to dependence within
blocks. Without shrinkage, a candidate of many columns, as the generic ones, would lose by its noise to a wrong one of
few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.candidates.coefficients import ExactFit
from push_predictor.residuals.evidence.residualizer import Residualizer, sums_by
from push_predictor.residuals.selection.screening import TINY
from push_predictor.types import Array, BoolArray, IntArray

FOLDS = 5


@dataclass(frozen=True, eq=False)
class Judged:
    """A candidate with its gain (blocks,) in nats, cross-validated.

    exact: None, or the exact fit whose gain it is, with the responses there as those of the candidate.
    """

    candidate: Candidate
    gains: Array
    exact: ExactFit | None = None

    @property
    def gain(self) -> float:
        """Sum of the gains, nats."""
        return float(self.gains.sum())

    @property
    def error(self) -> float:
        """Standard error of the gain from block to block, nats."""
        return float(np.sqrt(len(self.gains)) * self.gains.std())


def judge(candidates: Sequence[Candidate], z: Array, controls: Array, block: IntArray) -> list[Judged]:
    """Candidates with their gains on residuals z (n, 3), best first; the controls (n, m) are regressed out of both."""
    residualizer = Residualizer(controls)
    residual = residualizer(z)
    judged = [Judged(c, gains_of(residual, residualizer(c.columns), block)) for c in candidates]
    return sorted(judged, key=lambda j: -j.gain)


def folds_of(block: IntArray) -> IntArray:
    """Fold (n,) of every window; blocks take turns, so that every fold spans the whole session."""
    return block % FOLDS


def fit(flat: Array, residual: Array, block: IntArray | None = None) -> Array:
    """Least-squares coefficients (p,) of columns (n, 3, p) for residuals (n, 3); shrunk if blocks are given."""
    numbers = np.arange(len(residual)) if block is None else block
    x = flat.reshape(-1, flat.shape[2])
    scores, information = sums_by(numbers, np.einsum("nkp,nk->np", flat, residual)), x.T @ x
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * max(values[-1], np.finfo(float).tiny)
    root = vectors[:, keep] / np.sqrt(values[keep])
    each = scores @ root
    estimate = each.sum(axis=0)
    return np.asarray(root @ (estimate * (1.0 if block is None else _james_stein(estimate, each))))


def judged_exactly(exact: ExactFit, z: Array, residualizer: Residualizer, block: IntArray) -> Judged:
    """An exact fit with its gain on residuals z (n, 3), a nat less for each of its coefficients."""
    before, after = residualizer(z), residualizer(z - exact.shift)
    old, new = (np.mean(r**2, axis=0) for r in (before, after))
    gains = sums_by(block, (_log_density(after, new) - _log_density(before, old))[:, None])[:, 0]
    return Judged(exact.candidate, gains - exact.candidate.plain.shape[2] / len(gains), exact)


def gains_of(residual: Array, flat: Array, block: IntArray) -> Array:
    """Gain per block: log density of the residuals after minus before, each output with its own variance."""
    gains = np.zeros(len(residual))
    folds = folds_of(block)
    for fold in range(FOLDS):
        test = folds == fold
        if test.any() and not test.all():
            gains[test] = _gain(residual, flat, block, test)
    return sums_by(block, gains[:, None])[:, 0]


def _gain(residual: Array, flat: Array, block: IntArray, test: BoolArray) -> Array:
    rest = ~test
    after = residual - flat @ fit(flat[rest], residual[rest], block[rest])
    old, new = (np.mean(r[rest] ** 2, axis=0) for r in (residual, after))
    return _log_density(after[test], new) - _log_density(residual[test], old)


def _james_stein(estimate: Array, each: Array) -> float:
    """1 - noise / (noise + signal); the noise is the spread of the blocks' scores about their mean."""
    size = float(estimate @ estimate)
    noise = float(np.sum((each - each.mean(axis=0)) ** 2))
    return max(0.0, 1.0 - noise / size) if size > 0.0 else 0.0


def _log_density(residuals: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * np.sum(np.log(variance) + residuals**2 / variance, axis=1))
