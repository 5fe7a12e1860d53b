"""Which candidates explain more of the residual than chance: a family-wise p value for each.

The model's inputs are taken out of residual and candidate alike (Frisch and Waugh 1933), so that what a base model
could have learnt in its own inputs is not put down to a covariate. The statistic is the sum of squares that the
candidate's columns explain; its null distribution comes from a wild bootstrap with one sign per block of pushes
(Cameron, Gelbach and Miller 2008), the same signs for all candidates; the largest of all gives the family-wise p
(Westfall and Young 1993). No covariance of the columns is inverted: with many columns and few blocks it would be noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.residuals.evidence.residualizer import ResidualBlocks, Residualizer, sums_by
from push_predictor.types import Array, IntArray

DRAWS = 1999
TINY = 1e-6  # relative; directions of a candidate that the inputs explain away are dropped


@dataclass(frozen=True, eq=False)
class Screened:
    """By candidate (c,): statistic on a scale common to all (standard normal by chance), family-wise p value.

    largest: of each bootstrap draw. standing: the candidates that chance does not explain, but training has as well.
    """

    statistic: Array
    p_value: Array
    largest: Array
    standing: tuple[int, ...] = ()

    def threshold(self, alpha: float) -> float:
        """Statistic that chance exceeds anywhere with probability alpha."""
        return float(np.quantile(self.largest, 1.0 - alpha))


@dataclass(frozen=True, eq=False)
class Scores:
    """What each block adds to the score of each column, rows (b, p), for the bootstrap; their true sum, total (p,).

    The rows are of residuals made as large as they were before the inputs were fitted: what is left after a rich fit is
    too small, and chance would look rarer than it is (Bell and McCaffrey 2002: a block's rows times (1 - H)^-1/2).
    """

    rows: Array
    total: Array

    def turned(self, by: Array) -> Scores:
        """In other coordinates: by (p, q)."""
        return Scores(self.rows @ by, self.total @ by)

    def beside(self, other: Scores) -> Scores:
        """The blocks of both, for one sum."""
        return Scores(np.vstack([self.rows, other.rows]), self.total + other.total)

    def padded(self, blocks: int) -> Scores:
        """With more blocks, which add nothing."""
        return Scores(np.vstack([self.rows, np.zeros((blocks, self.rows.shape[1]))]), self.total)


def screen(scores: Sequence[Scores], seed: int = 0) -> Screened:
    """Screen candidates by their block scores, each in coordinates in which its information is one."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(DRAWS, len(scores[0].rows)))
    statistic, largest = np.empty(len(scores)), np.full(DRAWS, -np.inf)
    for k, score in enumerate(scores):
        statistic[k], drawn = _statistics(score, signs)
        np.maximum(largest, drawn, out=largest)
    exceeded = np.sum(largest[None, :] >= statistic[:, None], axis=1)
    return Screened(statistic, (1.0 + exceeded) / (1.0 + DRAWS), largest)


def block_scores(z: Array, columns: Array, basis: Array, block: IntArray) -> Scores:
    """Scores of columns (n, 3, p) for residuals z (n, 3); the basis (n, m) is taken out of both, per output."""
    out = Residualizer(basis)
    return unit_scores(*raw_scores(out.left(z, block), out(columns)))


def unit_scores(scores: Scores, information: Array) -> Scores:
    """Scores in coordinates in which the information (p, p) is one."""
    values, vectors = np.linalg.eigh(information)
    keep = values > TINY * max(values[-1], np.finfo(float).tiny)
    return scores.turned(vectors[:, keep] / np.sqrt(values[keep]))


def raw_scores(left: ResidualBlocks, flat: Array) -> tuple[Scores, Array]:
    """Scores of columns (n, 3, p) that are without the inputs, and the columns' information (p, p)."""
    x = flat.reshape(-1, flat.shape[2])
    rows = sums_by(left.block, np.einsum("nkp,nk->np", flat, left.enlarged))
    return Scores(rows, x.T @ left.left.ravel()), x.T @ x


def _statistics(score: Scores, signs: Array) -> tuple[float, Array]:
    """Sum of squares explained, and with the signs of each draw, as standard normal values."""
    scale = moments(score)
    if scale is None:
        return -np.inf, np.full(len(signs), -np.inf)
    unit, freedom = scale
    observed = np.array(score.total @ score.total)
    drawn = np.sum((signs @ score.rows) ** 2, axis=1)
    return float(_normal(observed / unit, freedom)), _normal(drawn / unit, freedom)


def moments(score: Scores) -> tuple[float, float] | None:
    """Unit and freedom of the chi squared with the draws' mean and variance (Satterthwaite 1946), if they vary."""
    gram = score.rows.T @ score.rows
    mean = float(np.trace(gram))
    variance = 2.0 * float(np.sum(gram**2) - np.sum(np.sum(score.rows**2, axis=1) ** 2))
    return None if variance <= 1e-12 * mean**2 else (variance / (2.0 * mean), 2.0 * mean**2 / variance)


def _normal(chi_squared: Array, freedom: float) -> Array:
    """Wilson and Hilferty 1931: what is chi squared with this freedom becomes nearly standard normal."""
    spread = 2.0 / (9.0 * freedom)
    return np.asarray((np.cbrt(chi_squared / freedom) - (1.0 - spread)) / np.sqrt(spread))
