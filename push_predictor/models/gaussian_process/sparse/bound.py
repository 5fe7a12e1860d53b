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

"""The variational bound of a VHGP with inducing inputs for f and g (derived in docs/explanation/sparse.md).

With u = f(Z), v = g(Z') - mu0, q(f, g) = p(f | u) q(u) p(g | v) q(v) and q(u) the best for the noise (Titsias 2009)

    F = log N(y | 0, Q_f + D) - 1/2 sum_i c_f,i / D_i - 1/4 sum_i s_i - KL(q(v) || p(v)),   D = R + jitter
    R_i = exp(m_i - s_i / 2),   m, s: mean and variance of g at the rows,   c_f = diag(K_f - Q_f)

F depends on q(v) through m and s alone, so at a maximum q(v) is also the prior times one Gaussian site per row, as in
vhgp_bound.py: S^-1 = Q_g^-1 + Lambda, m = mu0 + Q_g b, b = Lambda - 1/2. If every row is an inducing
input, this is the bound there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.gaussian_process.sparse.kernel import InducedKernel, InducedRidge
from push_predictor.models.gaussian_process.vhgp_bound import Sites, sites_from
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.types import Array

_SMALLEST_PRECISION = 1e-7


@dataclass(frozen=True, eq=False)
class SparseProblem:
    """Training rows (n, D) and (n,), hyperparameters, and both kernels projected on the inducing inputs."""

    outputs: Array
    parameters: VhgpParameters
    signal: InducedKernel
    noise: InducedKernel

    @classmethod
    def of(
        cls, inputs: Array, outputs: Array, parameters: VhgpParameters, of_signal: Array, of_noise: Array
    ) -> SparseProblem:
        """The problem for inducing inputs (m, D) of f and of g. Raises LinAlgError if they are too close together."""
        signal = InducedKernel.of(parameters.signal, inputs, of_signal)
        noise = InducedKernel.of(parameters.noise, inputs, of_noise)
        return cls(outputs, parameters, signal, noise)


@dataclass(frozen=True, eq=False)
class SparseSignal:
    """The signal given the noise."""

    level: Array  # R
    ridge: InducedRidge
    alpha: Array  # (Q_f + D)^-1 y
    value: float  # log N(y | 0, Q_f + D) - 1/2 sum c_f / D

    @classmethod
    def of(cls, problem: SparseProblem, noise_mean: Array, noise_variances: Array) -> SparseSignal:
        """The signal for moments of q(g) at the rows. Raises LinAlgError or FloatingPointError if it is not finite."""
        with np.errstate(over="raise", invalid="raise"):
            level = np.exp(noise_mean - 0.5 * noise_variances)
            jittered = level + problem.parameters.jitter
            constant = np.log(2.0 * np.pi * jittered).sum()
        weights = 1.0 / jittered
        ridge = problem.signal.regularise(weights)
        alpha = ridge.residual(weights * problem.outputs)
        fit = problem.outputs @ alpha + ridge.log_determinant + constant
        return cls(level, ridge, alpha, -0.5 * float(fit + weights @ problem.signal.unexplained))

    @cached_property
    def slopes(self) -> Array:
        """Derivative of the value by D, shape (n,)."""
        weights, ridge = self.ridge.weights, self.ridge
        uncertainty = ridge.posterior_diagonal + ridge.induced.unexplained
        return np.asarray(0.5 * (self.alpha**2 - weights + uncertainty * weights**2))

    @property
    def optimal_precisions(self) -> Array:
        """1/2 + dF/dm >= 0, shape (n,)."""
        return self.level * self.slopes + 0.5


@dataclass(frozen=True, eq=False)
class SparseBound:
    """F at one q(g), with the quantities that its derivatives share."""

    problem: SparseProblem
    sites: Sites
    mean_weights: Array  # b
    noise_mean: Array  # m
    noise_ridge: InducedRidge
    signal: SparseSignal
    value: float

    @classmethod
    def at(cls, problem: SparseProblem, sites: Sites) -> SparseBound:
        """Evaluate F. Raises LinAlgError or FloatingPointError where it is not a finite number."""
        prior_mean = problem.parameters.noise_mean
        ridge = problem.noise.regularise(sites.precisions)
        explained = ridge.posterior_diagonal
        mean_weights = ridge.residual(sites.potentials - sites.precisions * prior_mean)
        deviation = problem.noise.times(mean_weights)
        variances = explained + problem.noise.unexplained
        signal = SparseSignal.of(problem, prior_mean + deviation, variances)
        divergence = deviation @ mean_weights - sites.precisions @ explained + ridge.log_determinant
        value = signal.value - 0.25 * float(variances.sum()) - 0.5 * float(divergence)
        if not np.isfinite(value):
            raise FloatingPointError("the variational bound is not finite")
        return cls(problem, sites, mean_weights, prior_mean + deviation, ridge, signal, value)

    @classmethod
    def tied(cls, problem: SparseProblem, site_precisions: Array) -> SparseBound:
        """F as a function of the site precisions (n,) alone, b = Lambda - 1/2."""
        mean_weights = site_precisions - 0.5
        mean = problem.parameters.noise_mean + problem.noise.times(mean_weights)
        return cls.at(problem, Sites(site_precisions, site_precisions * mean + mean_weights))

    @property
    def optimal_sites(self) -> Sites:
        """The sites at which a natural-gradient step of length 1 ends."""
        return sites_from(self.signal.optimal_precisions, self.noise_mean)

    @property
    def tied_precisions(self) -> Array:
        """Site precisions tied to these mean weights, with the same m; see vhgp_bound.py."""
        return np.maximum(self.mean_weights + 0.5, _SMALLEST_PRECISION)

    def hyperparameter_gradient(self) -> Array:
        """dF/d(parameters.to_vector()) where F is at its maximum over q(g), (2 D + 3,)."""
        weights = self.signal.optimal_precisions - 0.5
        signal = self.signal.ridge.gradient(self.signal.alpha)
        signal[-1] += 2.0 * self.problem.parameters.jitter * float(self.signal.slopes.sum())
        noise = self.noise_ridge.gradient(weights, weights - self.mean_weights)
        return np.concatenate([signal, noise, [weights.sum()]])
