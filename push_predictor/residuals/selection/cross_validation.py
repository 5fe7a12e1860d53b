# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

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
    gains = HeldOutGains.of(residual, block)
    judged = [Judged(c, gains.of_columns(residualizer(c.columns))) for c in candidates]
    return sorted(judged, key=lambda j: -j.gain)


def folds_of(block: IntArray) -> IntArray:
    """Fold (n,) of every window; blocks take turns, so that every fold spans the whole session."""
    return block % FOLDS


def fit(flat: Array, residual: Array, block: IntArray | None = None) -> Array:
    """Least-squares coefficients (p,) of columns (n, 3, p) for residuals (n, 3); shrunk if blocks are given."""
    numbers = np.arange(len(residual)) if block is None else block
    return _coefficients(_scores(flat, residual, numbers), _information(flat), shrunk=block is not None)


def judged_exactly(exact: ExactFit, z: Array, residualizer: Residualizer, block: IntArray) -> Judged:
    """An exact fit with its gain on residuals z (n, 3), a nat less for each of its coefficients."""
    before, after = residualizer(z), residualizer(z - exact.shift)
    gains = log_gains(before, after, block)
    return Judged(exact.candidate, gains - exact.candidate.plain.shape[2] / len(gains), exact)


def log_gains(before: Array, after: Array, block: IntArray) -> Array:
    """Log density per block of residuals (n, 3) after minus before, each output with its own variance."""
    old, new = (np.mean(r**2, axis=0) for r in (before, after))
    return sums_by(block, (_log_density(after, new) - _log_density(before, old))[:, None])[:, 0]


def gains_of(residual: Array, flat: Array, block: IntArray) -> Array:
    """Gain per block: log density of the residuals after minus before, each output with its own variance."""
    return HeldOutGains.of(residual, block).of_columns(flat)


@dataclass(frozen=True, eq=False)
class HeldOutGains:
    """Gains of columns on residuals (n, 3): what is the same for all columns is computed once.

    block (n,): of each row. fold (n,): number among the folds that are used; used (f, b): the blocks of a fold's fit;
    weights (f, n): of their rows, for a mean. before (n,): log density of the residuals, with the variance of
    the other folds.
    """

    residual: Array
    block: IntArray
    fold: IntArray
    used: BoolArray
    weights: Array
    before: Array

    @staticmethod
    def of(residual: Array, block: IntArray) -> HeldOutGains:
        """Folds of the blocks, which take turns."""
        numbers, fold = np.unique(folds_of(block), return_inverse=True)
        used = folds_of(np.unique(block)) != numbers[:, None]
        weights = (fold != np.arange(len(numbers))[:, None]).astype(np.float64)
        weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1.0)
        if len(numbers) < 2:
            return HeldOutGains(residual, block, fold, used, weights, np.zeros(len(residual)))
        variance = weights @ residual**2
        return HeldOutGains(residual, block, fold, used, weights, _log_density(residual, variance[fold]))

    def of_columns(self, flat: Array) -> Array:
        """Gain (b,) per block of columns (n, 3, p): fitted on the other folds, the log density after minus before.

        A fold's fit needs only sums over the other folds: these are those over all rows without the fold's own.
        """
        folds, blocks = self.used.shape
        if folds < 2:
            return np.zeros(blocks)
        own = np.stack([_information(flat[self.fold == k]) for k in range(folds)])
        coefficients = _shrunk(_scores(flat, self.residual, self.block), own.sum(axis=0) - own, self.used)
        fitted = coefficients @ flat.reshape(-1, flat.shape[2]).T
        after = self.residual - fitted.reshape(folds, *self.residual.shape)
        held_out = after[self.fold, np.arange(len(self.fold))]
        variance = np.stack([mean @ square for mean, square in zip(self.weights, after**2, strict=True)])
        gains = _log_density(held_out, variance[self.fold]) - self.before
        return sums_by(self.block, gains[:, None])[:, 0]


def _scores(flat: Array, residual: Array, block: IntArray) -> Array:
    """Sums (b, p) over each block of columns (n, 3, p) times residuals (n, 3)."""
    return sums_by(block, np.einsum("nkp,nk->np", flat, residual))


def _information(flat: Array) -> Array:
    """Products (p, p) of columns (n, 3, p)."""
    x = flat.reshape(-1, flat.shape[2])
    return np.asarray(x.T @ x)


def _coefficients(scores: Array, information: Array, *, shrunk: bool) -> Array:
    """Coefficients (p,) from the blocks' scores (b, p) and the columns' information (p, p)."""
    if shrunk:
        return np.asarray(_shrunk(scores, information[None], np.ones((1, len(scores)), dtype=np.bool_))[0])
    root = _root(information)
    return np.asarray(root @ (scores @ root).sum(axis=0))


def _shrunk(scores: Array, information: Array, used: BoolArray) -> Array:
    """Shrunk coefficients (f, p) of f fits, by the scores (b, p) of the blocks that each uses (f, b).

    information (f, p, p). The factor is 1 - noise / (noise + signal), of James and Stein; the noise is the spread of
    the blocks' scores about their mean.
    """
    root, part = _root(information), used[:, :, None].astype(np.float64)
    each = scores @ root * part
    estimate = each.sum(axis=1)
    size, mean = np.sum(estimate**2, axis=1), estimate / part.sum(axis=1)
    noise = np.sum(((each - mean[:, None, :]) * part) ** 2, axis=(1, 2))
    factor = np.where(size > 0.0, np.maximum(0.0, 1.0 - noise / np.where(size > 0.0, size, 1.0)), 0.0)
    return np.asarray((root @ (estimate * factor[:, None])[:, :, None])[:, :, 0])


def _root(information: Array) -> Array:
    """Square root (..., p, p) of the pseudoinverse of information (..., p, p); zero along what is not determined."""
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * np.maximum(values[..., -1:], np.finfo(float).tiny)
    return np.asarray(vectors * np.where(keep, 1.0 / np.sqrt(np.where(keep, values, 1.0)), 0.0)[..., None, :])


def _log_density(residuals: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * np.sum(np.log(variance) + residuals**2 / variance, axis=1))
