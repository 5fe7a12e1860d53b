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

"""Leave-block-out predictions in closed form, from one factorisation.

For a Gaussian process with P = (K + D)^-1 and a block B of its rows held out (Rasmussen and Williams 2006, section
5.4.2, for a block in place of a row)

    mean = y_B - P_BB^-1 (P y)_B,     variance of y = diag P_BB^-1

A VHGP consists of two: the signal, seen through the noise level R, and the log noise variance, seen through the sites
of q(g), whose values are m + b / Lambda (vhgp_bound.py). R and the sites of the other rows are kept: refitting them
without B changes them little, and takes forty times as long (Vehtari et al. 2016, "Bayesian leave-one-out
cross-validation approximations for Gaussian latent variable models").
"""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array, IntArray


def held_out_errors(precision: Array, weights: Array, block: IntArray) -> tuple[Array, Array]:
    """Errors (n,) of the leave-block-out predictions of n values, and their variances (n,).

    precision (n, n): P; weights (n,): P times the values; block (n,): number of each row's block.
    """
    errors, variance = np.empty(len(weights)), np.empty(len(weights))
    for number in np.unique(block):
        rows = np.flatnonzero(block == number)
        covariance = np.linalg.inv(precision[np.ix_(rows, rows)])
        errors[rows], variance[rows] = covariance @ weights[rows], np.diagonal(covariance)
    return errors, variance
