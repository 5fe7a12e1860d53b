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

"""Bayesian update of the forward model's parameters: what pushes say about them in addition to their priors.

The most probable values of all parameters together, with the Laplace approximation of their covariance, and the size of
the process noise. The windows of a push share their deviation, so each of m windows counts as 1 / (1 + (m - 1) r) with
a correlation r: the information of a push with equal windows that correlate with r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.mechanics.fit import FitRows
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameter_draws import displacements, prior_spreads
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.process_noise import ProcessNoise
from push_predictor.types import Array

CORRELATION = 0.5  # of the windows of a push; planning/persistence.py finds 0.45 and more
NOISE_WINDOWS = 6.0  # independent windows that the prior of the noise variance is worth
DIFFERENCE = 0.05  # prior standard deviations
CONVERGED = 0.02  # prior standard deviations
MOST_STEPS = 15
SHORTENINGS = 4


@dataclass(frozen=True, eq=False)
class ParameterUpdate:
    """values (p,), their covariance (p, p), and the noise."""

    values: Array
    covariance: Array
    noise: ProcessNoise


def updated(
    mechanics: PushMechanics, names: tuple[str, ...], means: Array, rows: FitRows, length: float
) -> ParameterUpdate:
    """The parameters' posterior, from normal priors about `means` (p,) with the spreads of `prior_spreads`.

    length: c of the support in m, for the noise of the turn. Gauss-Newton steps within the plausible ranges, each
    shortened until the posterior grows; the noise's factor is estimated again after each. Deterministic.
    """
    return _Update(mechanics, names, means, rows, length).solved()


@dataclass(frozen=True, eq=False)
class _Local:
    """The model about some values: residuals (n, 3), derivatives (n, 3, p), noise (n, 3, 3) for a factor of 1."""

    residuals: Array
    jacobian: Array
    noise: Array


class _Update:
    def __init__(
        self, mechanics: PushMechanics, names: tuple[str, ...], means: Array, rows: FitRows, length: float
    ) -> None:
        self.mechanics, self.names, self.means, self.rows = mechanics, names, means, rows
        table = [BY_NAME[name] for name in names]
        self.low, self.high = np.array([p.low for p in table]), np.array([p.high for p in table])
        self.spread = prior_spreads(names)
        windows = np.bincount(rows.push)[rows.push]
        self.weight = 1.0 / (1.0 + (windows - 1.0) * CORRELATION)
        self.travel, self.length = rows.inputs[:, 0] * rows.duration, np.full(len(rows.push), length)

    def solved(self) -> ParameterUpdate:
        """See `updated`."""
        values, factor = self.means, np.ones(3)
        for _ in range(MOST_STEPS):
            local = self._local(values)
            precision = self._precision(local.noise, factor)
            curvature, slope = self._equations(local, precision, values)
            stepped = self._stepped(values, np.asarray(np.linalg.solve(curvature, slope)), local.residuals, precision)
            moved, values = stepped - values, stepped
            factor = self._factor(local, local.residuals - local.jacobian @ moved, _inverse(curvature))
            if np.max(np.abs(moved) / self.spread) < CONVERGED:
                break
        local = self._local(values)
        curvature, _ = self._equations(local, self._precision(local.noise, factor), values)
        return ParameterUpdate(values, _inverse(curvature), ProcessNoise(factor))

    def _local(self, values: Array) -> _Local:
        step = np.where(values + DIFFERENCE * self.spread > self.high, -DIFFERENCE, DIFFERENCE) * self.spread
        changed = ProcessNoise.changed(self.names, values)
        found = self._displacements(np.concatenate([changed, values + np.diag(step)]))
        jacobian = (found[:, len(changed) :] - found[:, :1]).transpose(0, 2, 1) / step
        noise = ProcessNoise().covariance(found[:, : len(changed)], self.travel, self.length)
        return _Local(self.rows.outcomes - found[:, 0], jacobian, noise)

    def _displacements(self, draws: Array) -> Array:
        rows = self.rows
        return displacements(self.mechanics, self.names, draws, rows.inputs, rows.duration, rows.covariates)

    def _precision(self, noise: Array, factor: Array) -> Array:
        root = np.sqrt(factor)
        return np.asarray(np.linalg.inv(noise * root[:, None] * root) * self.weight[:, None, None])

    def _equations(self, local: _Local, precision: Array, values: Array) -> tuple[Array, Array]:
        """Curvature (p, p) and slope (p,) of the log posterior."""
        weighted = np.einsum("nkp,nkl->npl", local.jacobian, precision)
        curvature = np.einsum("npl,nlq->pq", weighted, local.jacobian) + np.diag(self.spread**-2.0)
        slope = np.einsum("npl,nl->p", weighted, local.residuals) + (self.means - values) / self.spread**2
        return curvature, slope

    def _stepped(self, values: Array, step: Array, residuals: Array, precision: Array) -> Array:
        before = self._misfit(values, residuals, precision)
        for k in range(SHORTENINGS):
            trial = np.clip(values + step * 0.4**k, self.low, self.high)
            after = self.rows.outcomes - self._displacements(trial[None])[:, 0]
            if self._misfit(trial, after, precision) < before:
                return trial
        return values

    def _misfit(self, values: Array, residuals: Array, precision: Array) -> float:
        prior = np.sum(((values - self.means) / self.spread) ** 2)
        return float(np.einsum("nk,nkl,nl->", residuals, precision, residuals) + prior)

    def _factor(self, local: _Local, residuals: Array, covariance: Array) -> Array:
        """Factor (3,) of the noise: the mean of its prior, 1, and of the residuals, weighted by windows.

        The residuals count with the uncertainty of the parameters, which a fit to these rows hides.
        """
        unsure = np.einsum("nkp,pq,nkq->nk", local.jacobian, covariance, local.jacobian)
        ratio = (residuals**2 + unsure) / np.diagonal(local.noise, axis1=1, axis2=2)
        return np.asarray((NOISE_WINDOWS + self.weight @ ratio) / (NOISE_WINDOWS + self.weight.sum()))


def _inverse(matrix: Array) -> Array:
    inverse = np.asarray(np.linalg.inv(matrix))
    return 0.5 * (inverse + inverse.T)
