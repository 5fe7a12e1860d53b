# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which candidates explain more of the residual than chance: a family-wise p value for each.

The model's inputs are regressed out of residual and candidate alike (Frisch and Waugh 1933), so that an error which a
base model could have learnt from its own inputs is not attributed to a covariate. The statistic is the sum of squares
that the candidate's columns explain. Its null distribution comes from a wild bootstrap with one sign per block of
pushes (Cameron, Gelbach and Miller 2008), the same signs for all candidates. The largest statistic of each draw gives
the family-wise p (Westfall and Young 1993). No covariance of the columns is inverted: with many columns and few blocks
it would be noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.residuals.evidence.residualizer import ResidualBlocks, sums_by
from push_predictor.types import Array

DRAWS = 1999
AT_ONCE = 32  # candidates whose draws are computed together: their table stays small
TINY = 1e-6  # relative; directions of a candidate that the inputs explain are dropped


@dataclass(frozen=True, eq=False)
class Screened:
    """Statistic and family-wise p value of each candidate (c,); by chance the statistic is standard normal.

    largest: statistic of each bootstrap draw. unchanged: candidates that are significant, but as much so in training.
    """

    statistic: Array
    p_value: Array
    largest: Array
    unchanged: tuple[int, ...] = ()

    def threshold(self, alpha: float) -> float:
        """Statistic that any candidate exceeds by chance with probability alpha."""
        return float(np.quantile(self.largest, 1.0 - alpha))


@dataclass(frozen=True, eq=False)
class Scores:
    """Score of each column: contribution of each block, rows (b, p), and the observed sum, total (p,).

    The rows, which the bootstrap signs, come from the adjusted residuals of ResidualBlocks.
    """

    rows: Array
    total: Array

    def turned(self, by: Array) -> Scores:
        """The scores in other coordinates; by (p, q)."""
        return Scores(self.rows @ by, self.total @ by)

    def stacked_on(self, other: Scores) -> Scores:
        """The blocks of both scores, for one sum."""
        return Scores(np.vstack([self.rows, other.rows]), self.total + other.total)

    def padded(self, blocks: int) -> Scores:
        """The scores with further blocks that contribute zero."""
        return Scores(np.vstack([self.rows, np.zeros((blocks, self.rows.shape[1]))]), self.total)


def screen(scores: Sequence[Scores], seed: int = 0) -> Screened:
    """Screen candidates by their scores, each in coordinates in which its information is the identity."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(DRAWS, len(scores[0].rows)))
    statistic, largest = np.full(len(scores), -np.inf), np.full(DRAWS, -np.inf)
    scales = {k: scale for k, score in enumerate(scores) if (scale := moments(score)) is not None}
    for first in range(0, len(scales), AT_ONCE):
        part = list(scales)[first : first + AT_ONCE]
        unit, freedom = np.array([scales[k] for k in part]).T
        statistic[part] = _normal(np.array([scores[k].total @ scores[k].total for k in part]) / unit, freedom)
        drawn = _squares_drawn([scores[k].rows for k in part], signs)
        np.maximum(largest, _normal(drawn / unit, freedom).max(axis=1), out=largest)
    exceeded = np.sum(largest[None, :] >= statistic[:, None], axis=1)
    return Screened(statistic, (1.0 + exceeded) / (1.0 + DRAWS), largest)


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns (n, 3, p) with the controls regressed out, to be scored on any residuals."""

    flat: Array

    @cached_property
    def information(self) -> Array:
        """Their products (p, p)."""
        x = self.flat.reshape(-1, self.flat.shape[2])
        return np.asarray(x.T @ x)

    @cached_property
    def unit(self) -> Array:
        """Coordinates (p, q) in which the information is the identity."""
        values, vectors = np.linalg.eigh(self.information)
        keep = values > TINY * max(values[-1], np.finfo(float).tiny)
        return np.asarray(vectors[:, keep] / np.sqrt(values[keep]))

    def scores(self, blocks: ResidualBlocks) -> Scores:
        """Their scores on these residuals."""
        rows = sums_by(blocks.block, np.einsum("nkp,nk->np", self.flat, blocks.adjusted))
        return Scores(rows, self.flat.reshape(-1, self.flat.shape[2]).T @ blocks.residual.ravel())


def _squares_drawn(rows: Sequence[Array], signs: Array) -> Array:
    """Sums of squares (draws, k) that k candidates explain with the signs of each draw; rows (b, p) of each."""
    starts = np.cumsum([0, *(each.shape[1] for each in rows[:-1])])
    return np.asarray(np.add.reduceat((signs @ np.hstack(rows)) ** 2, starts, axis=1))


def moments(score: Scores) -> tuple[float, float] | None:
    """Scale and degrees of freedom of the chi-squared with the draws' mean and variance (Satterthwaite 1946)."""
    gram = score.rows.T @ score.rows
    mean = float(np.trace(gram))
    variance = 2.0 * float(np.sum(gram**2) - np.sum(np.sum(score.rows**2, axis=1) ** 2))
    return None if variance <= 1e-12 * mean**2 else (variance / (2.0 * mean), 2.0 * mean**2 / variance)


def _normal(chi_squared: Array, freedom: Array) -> Array:
    """Nearly standard normal values of chi-squared variables (..., k), freedom (k,) (Wilson and Hilferty 1931)."""
    spread = 2.0 / (9.0 * freedom)
    return np.asarray((np.cbrt(chi_squared / freedom) - (1.0 - spread)) / np.sqrt(spread))
