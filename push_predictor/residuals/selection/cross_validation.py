# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
from push_predictor.types import Array, IntArray

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
    """Gain per block: log density of the residuals after minus before, each output with its own variance.

    A fold's fit needs only sums over the other folds: these are those over all rows without the fold's own.
    """
    every, of_block = folds_of(block), folds_of(np.unique(block))
    used, fold = np.unique(every, return_inverse=True)
    if len(used) < 2:
        return np.zeros(len(of_block))
    scores, own = _scores(flat, residual, block), [_information(flat[fold == k]) for k in range(len(used))]
    total = np.sum(own, axis=0)
    fits = [_coefficients(scores[of_block != k], total - part, shrunk=True) for k, part in zip(used, own, strict=True)]
    after = residual - np.stack([_fitted(flat, coefficients) for coefficients in fits])  # (folds, n, 3)
    rest = (fold != np.arange(len(used))[:, None]).astype(np.float64)
    rest /= rest.sum(axis=1, keepdims=True)
    old, new = rest @ residual**2, np.stack([mean @ square for mean, square in zip(rest, after**2, strict=True)])
    held_out = after[fold, np.arange(len(fold))]
    gains = _log_density(held_out, new[fold]) - _log_density(residual, old[fold])
    return sums_by(block, gains[:, None])[:, 0]


def _scores(flat: Array, residual: Array, block: IntArray) -> Array:
    """Sums (b, p) over each block of columns (n, 3, p) times residuals (n, 3)."""
    return sums_by(block, np.einsum("nkp,nk->np", flat, residual))


def _fitted(flat: Array, coefficients: Array) -> Array:
    """Sum (n, 3) of columns (n, 3, p) times coefficients (p,)."""
    return np.asarray(flat.reshape(-1, len(coefficients)) @ coefficients).reshape(len(flat), 3)


def _information(flat: Array) -> Array:
    """Products (p, p) of columns (n, 3, p)."""
    x = flat.reshape(-1, flat.shape[2])
    return np.asarray(x.T @ x)


def _coefficients(scores: Array, information: Array, *, shrunk: bool) -> Array:
    """Coefficients (p,) from the blocks' scores (b, p) and the columns' information (p, p)."""
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * max(values[-1], np.finfo(float).tiny)
    root = vectors[:, keep] / np.sqrt(values[keep])
    each = scores @ root
    estimate = each.sum(axis=0)
    return np.asarray(root @ (estimate * (_james_stein(estimate, each) if shrunk else 1.0)))


def _james_stein(estimate: Array, each: Array) -> float:
    """1 - noise / (noise + signal); the noise is the spread of the blocks' scores about their mean."""
    size = float(estimate @ estimate)
    noise = float(np.sum((each - each.mean(axis=0)) ** 2))
    return max(0.0, 1.0 - noise / size) if size > 0.0 else 0.0


def _log_density(residuals: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * np.sum(np.log(variance) + residuals**2 / variance, axis=1))
