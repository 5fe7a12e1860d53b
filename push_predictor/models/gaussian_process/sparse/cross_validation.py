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

"""Leave-block-out predictions of a sparse VHGP in closed form, as cross_validation.py has them for dense ones.

With Q for K the formulas are those there, and the variance that the inducing inputs do not explain is added. The
inducing inputs are kept. Without a block B the whitened inducing variables have the precision C = I + V' W V less what
B adds, and P_BB^-1 = W_B^-1 + V_B C^-1 V_B'.
"""

from __future__ import annotations

import numpy as np
import scipy

from push_predictor.models.gaussian_process.matrices.ridge import cholesky_in_place
from push_predictor.models.gaussian_process.sparse.kernel import InducedRidge
from push_predictor.types import Array, IntArray


def sparse_held_out_errors(ridge: InducedRidge, weights: Array, block: IntArray) -> tuple[Array, Array]:
    """Errors (n,) of the leave-block-out predictions of n values, and their variances (n,).

    weights (n,): P times the values; block (n,): number of each row's block.
    """
    errors, variance = np.empty(len(weights)), np.empty(len(weights))
    order = np.argsort(block, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(block[order])) + 1):
        known = _covariance_without(ridge, rows)
        noise = 1.0 / ridge.weights[rows]
        features = ridge.induced.features[rows]
        errors[rows] = noise * weights[rows] + features @ (known @ (features.T @ weights[rows]))
        variance[rows] = noise + np.einsum("ij,ij->i", features @ known, features)
    return errors, variance


def _covariance_without(ridge: InducedRidge, rows: IntArray) -> Array:
    """C^-1 (m, m): covariance of the whitened inducing variables given all rows but these."""
    weighted = ridge.induced.features[rows] * np.sqrt(ridge.weights[rows])[:, None]
    factor = cholesky_in_place(np.ascontiguousarray(ridge.inner - weighted.T @ weighted))
    return np.asarray(scipy.linalg.cho_solve((factor, True), np.eye(len(factor))))
