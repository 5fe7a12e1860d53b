"""What a sparse VHGP says of its own rows when it has not seen them, block by block; left_out.py does it for others.

With Q for K the formulas are those there, and what the inducing inputs do not tell of a row is added to its variance.
The inducing inputs stay. Without a block B the whitened inducing variables have the precision C = I + V' W V less what
B adds, and P_BB^-1 = W_B^-1 + V_B C^-1 V_B'.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_solve

from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.ridge import cholesky_in_place
from push_predictor.models.gaussian_process.sparse.kernel import InducedRidge
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.types import Array, IntArray


def sparse_left_out(regression: SparseVHGP, block: IntArray) -> LatentPrediction:
    """Predict f and g at each of the n training rows by the rows of all other blocks; see left_out.left_out."""
    bound, parameters = regression.solved(), regression.parameters
    missing, variance = _missing(bound.signal.ridge, bound.signal.alpha, block)
    not_told, of_noise = _missing(bound.noise_ridge, bound.mean_weights, block)
    seen_through = 1.0 / bound.sites.precisions
    variance += bound.problem.signal.missing - bound.signal.level
    of_noise += bound.problem.noise.missing - seen_through
    return LatentPrediction(
        regression.outputs - missing,
        np.maximum(variance, parameters.jitter),
        bound.noise_mean + bound.mean_weights * seen_through - not_told,
        np.maximum(of_noise, np.finfo(float).eps * parameters.noise.variance),
    )


def _missing(ridge: InducedRidge, weights: Array, block: IntArray) -> tuple[Array, Array]:
    """What the other rows miss the values of each row by (n,), and the variance of that (n,).

    weights (n,): P times the values.
    """
    missing, variance = np.empty(len(weights)), np.empty(len(weights))
    order = np.argsort(block, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(block[order])) + 1):
        known = _known_to_others(ridge, rows)
        noise = 1.0 / ridge.weights[rows]
        features = ridge.induced.features[rows]
        missing[rows] = noise * weights[rows] + features @ (known @ (features.T @ weights[rows]))
        variance[rows] = noise + np.einsum("ij,ij->i", features @ known, features)
    return missing, variance


def _known_to_others(ridge: InducedRidge, rows: IntArray) -> Array:
    """C^-1 (m, m): what the other rows leave of the whitened inducing variables' variance."""
    weighted = ridge.induced.features[rows] * np.sqrt(ridge.weights[rows])[:, None]
    factor = cholesky_in_place(np.ascontiguousarray(ridge.inner - weighted.T @ weighted))
    return np.asarray(cho_solve((factor, True), np.eye(len(factor))))
