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

"""Fitting the tails of a learnt predictor to the residuals of held-out training pushes.

Scale and degrees of freedom have the largest likelihood, under a weak prior of the degrees. Two things would make the
intervals of few pushes too narrow. Windows of one push resemble each other, so n windows of k pushes count for

    effective = n / (1 + RESEMBLANCE (n / k - 1))                    (the design effect, Kish 1965)

windows. And the hyperparameters were fitted to the residuals' own rows, so that the variance of new pushes is larger by

    (effective + hyperparameters) / (effective - hyperparameters)     (the final prediction error, Akaike 1970).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from push_predictor.models.predictors.tails import STEPS, Tails, student_log_density
from push_predictor.types import Array, IntArray

FEWEST_PUSHES = 3
RESEMBLANCE = 0.45  # correlation of windows of a push, as is typical (planning/persistence.py)
USUAL_EXCESS, EXCESS_SD = 2.0, 0.5  # prior of the degrees: log-normal of what they are above 2
LEAST_FREE = 0.5  # of the effective windows that stay, however many hyperparameters there are


def fit_tails(
    residuals: Array, covariance: Array, push_ids: np.ndarray, hyperparameters: Sequence[int]
) -> Tails | None:
    """The tails of residuals (n, 3) with predicted covariance (n, 3, 3), each row predicted without its push.

    push_ids (n,): the push of each row. hyperparameters: how many were fitted for each output. None for fewer than
    FEWEST_PUSHES pushes, or where a residual does not vary.
    """
    pushes, push = np.unique(push_ids, return_inverse=True)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    if len(pushes) < FEWEST_PUSHES or not np.all(np.any(residuals != 0.0, axis=0)):
        return None
    effective = len(push) / (1.0 + RESEMBLANCE * (len(push) / len(pushes) - 1.0))
    optimism = _optimism(effective, np.asarray(hyperparameters, dtype=np.float64))
    z = residuals / sd * optimism  # as those of new pushes
    scale, degrees = np.array([_likeliest(column[:, None], effective) for column in z.T]).T
    factor = scale * np.sqrt(degrees / (degrees - 2.0))
    joint_scale, joint_degrees = _likeliest(_whitened(z / factor, covariance, sd), effective)
    return Tails(scale, degrees, joint_scale, joint_degrees, len(pushes), _quantiles(np.abs(z / factor), push))


def _optimism(effective: float, hyperparameters: Array) -> Array:
    """Standard deviation of new residuals over that of residuals of rows that the hyperparameters have seen, (3,)."""
    left = np.maximum(effective - hyperparameters, LEAST_FREE * effective)
    return np.asarray(np.sqrt((effective + hyperparameters) / left))


def _likeliest(z: Array, effective: float) -> tuple[float, float]:
    """Scale and degrees of freedom of residuals (n, k) in k dimensions."""
    from scipy.optimize import minimize  # its import would take every node 0.2 s at the start

    distance, size = np.linalg.norm(z, axis=1), z.shape[1]
    start = np.array([0.5 * np.log(np.mean(distance**2) / size), np.log(USUAL_EXCESS)])

    def cost(vector: Array) -> float:
        scale, degrees = float(np.exp(vector[0])), 2.0 + float(np.exp(vector[1]))
        prior = 0.5 * ((vector[1] - start[1]) / EXCESS_SD) ** 2
        return float(prior - effective * np.mean(_radial_log_density(distance, size, scale, degrees)))

    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-6}).x
    return float(np.exp(found[0])), 2.0 + float(np.exp(found[1]))


def _radial_log_density(distance: Array, size: int, scale: float, degrees: float) -> Array:
    """Log density (n,) of a t distribution in `size` dimensions at distances (n,), up to a constant of `size`."""
    if size == 1:
        return student_log_density(distance, scale, degrees)
    constant = (
        scipy.special.gammaln(0.5 * (degrees + size))
        - scipy.special.gammaln(0.5 * degrees)
        - 0.5 * size * np.log(degrees)
    )
    reach = np.log1p((distance / scale) ** 2 / degrees)
    return np.asarray(constant - size * np.log(scale) - 0.5 * (degrees + size) * reach)


def _whitened(z: Array, covariance: Array, sd: Array) -> Array:
    """Standardised residuals (n, 3), whitened by the predicted correlation."""
    lower = np.linalg.cholesky(covariance / (sd[:, :, None] * sd[:, None, :]))
    return np.asarray(np.linalg.solve(lower, z[:, :, None])[:, :, 0])


def _quantiles(away: Array, push: IntArray) -> Array:
    """Quantiles (STEPS, 3) of residuals (n, 3) where every push counts the same; see Tails."""
    weight = 1.0 / np.bincount(push)[push] / (int(push.max()) + 1)
    wanted = np.arange(1, STEPS + 1) / STEPS
    columns = []
    for column in away.T:
        order = np.argsort(column)
        reached = np.cumsum(weight[order])
        place = np.searchsorted(reached, wanted - 1e-9)
        columns.append(column[order][np.minimum(place, len(order) - 1)])
    return np.column_stack(columns)
