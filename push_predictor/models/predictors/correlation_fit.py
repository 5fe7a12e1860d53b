# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Learning the correlation of the outputs from held-out pushes; the same pushes decide whether there is one.

The regressions predict each push without its windows (gaussian_process/ridge.py), and the correlation at a
push is smoothed over all others. Residuals have heavy tails, and a single outlier would determine the correlation of
its whole neighbourhood. So none counts for more than its expected length, 3^1/2 standard deviations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.predictors.correlation import Correlation, correlations, covariances
from push_predictor.models.predictors.gaussian_process_predictor import GaussianProcessPredictor
from push_predictor.types import Array, IntArray

BANDWIDTHS = (0.2, 0.3, 0.4, 0.6, 0.9, 1.4, 2.5)  # standard deviations of the features
SHRINKAGES = (2.0, 5.0, 10.0, 20.0, 50.0)  # rows
LONGEST = 3.0**0.5
FEWEST_PUSHES = 10
MOST_ROWS = 2000  # that it is learnt from and keeps, at random: a prediction must not cost more with more rows
MOST_BLOCKS = 300  # in which pushes are held out
CLEARLY = 2.0  # standard errors, from push to push


def fit_correlation(predictor: GaussianProcessPredictor, push_ids: np.ndarray) -> Correlation | None:
    """The correlation of a predictor's outputs, from its training rows and the push (n,) that each belongs to.

    Bandwidth and shrinkage maximise the likelihood of the held-out pushes. None, for independence, if that likelihood
    is not CLEARLY above the one of independent outputs, or if there are fewer than FEWEST_PUSHES.
    """
    pushes, push = np.unique(push_ids, return_inverse=True)
    if len(pushes) < FEWEST_PUSHES:
        return None
    block = np.asarray(push % MOST_BLOCKS, dtype=np.int64)
    best, gains = max(_candidates(predictor, block), key=lambda candidate: float(candidate[1].sum()))
    error = np.sqrt(len(gains)) * gains.std(ddof=1)
    return best if gains.sum() > CLEARLY * error else None


def _candidates(predictor: GaussianProcessPredictor, block: IntArray) -> Iterator[tuple[Correlation, Array]]:
    """Correlations, each with its gain in log likelihood of held-out pushes over independence, (blocks,) nats."""
    rows, count = np.sort(np.random.default_rng(0).permutation(len(block))[:MOST_ROWS]), len(block)
    known, features, block = _held_out(predictor, block, rows), predictor.regressions[0].inputs[rows], block[rows]
    kept = rows if len(rows) < count else None
    for bandwidth in BANDWIDTHS:
        smoother = Correlation(features, known.bounded, bandwidth, SHRINKAGES[0])
        sums = smoother.held_out_sums(features, block)
        for shrinkage in SHRINKAGES:
            gains = known.gains(correlations(sums, shrinkage))
            candidate = replace(smoother, shrinkage=shrinkage, rows=kept)
            yield candidate, np.asarray(np.bincount(block, gains), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _HeldOut:
    """Residuals of held-out rows, and the predicted variances of function and noise: (n, 3) each."""

    residuals: Array
    of_function: Array
    of_process: Array

    @property
    def bounded(self) -> Array:
        """Residuals in units of the prediction, none longer than LONGEST, rounded as in a model file."""
        scaled = self.residuals / np.sqrt(self.of_function + self.of_process)
        longest = np.maximum(np.linalg.norm(scaled, axis=1, keepdims=True), LONGEST)
        return np.asarray((scaled * LONGEST / longest).astype(np.float32), dtype=np.float64)

    def gains(self, correlation: Array) -> Array:
        """Log densities (n,) with correlation matrices (n, 3, 3) minus those of independent outputs."""
        joint, alone = (self._log_density(matrices) for matrices in (correlation, None))
        return np.asarray(joint - alone)

    def _log_density(self, correlation: Array | None) -> Array:
        covariance, _ = covariances(self.of_function, self.of_process, correlation)
        lower = np.linalg.cholesky(covariance)
        z = np.linalg.solve(lower, self.residuals[:, :, None])[:, :, 0]
        diagonal = np.diagonal(lower, axis1=1, axis2=2)
        return np.asarray(-0.5 * np.sum(z**2, axis=1) - np.sum(np.log(diagonal), axis=1))


def _held_out(predictor: GaussianProcessPredictor, block: IntArray, rows: IntArray) -> _HeldOut:
    latent = [regression.held_out(block) for regression in predictor.regressions]
    outputs = [regression.outputs for regression in predictor.regressions]
    return _HeldOut(
        np.column_stack([y - p.mean for y, p in zip(outputs, latent, strict=True)])[rows],
        np.column_stack([p.variance for p in latent])[rows],
        np.column_stack([p.process_variance for p in latent])[rows],
    )
