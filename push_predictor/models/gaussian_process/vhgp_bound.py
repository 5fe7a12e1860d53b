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

"""The variational bound of a VHGP and its derivatives (Lazaro-Gredilla and Titsias 2011, equation 7).

Where the printed equations differ from these: docs/explanation/errata.md.

    F = log N(y | 0, K_f + R) - 1/4 tr S - KL(N(m, S) || N(mu0, K_g)),     R_ii = exp(m_i - S_ii / 2)
    S^-1 = K_g^-1 + Lambda,     m = mu0 + K_g b,     Lambda diagonal ("site precisions"), b ("mean weights")

At a maximum over (b, Lambda) the two are tied, b = Lambda - 1/2, which leaves one number per training row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from push_predictor.models.gaussian_process.matrices.ridge import RegularisableKernel, Ridge, factorise
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.types import Array

_SMALLEST_PRECISION = 1e-7  # below it S loses its precision


@dataclass(frozen=True)
class VhgpProblem:
    """Training rows and hyperparameters with the two kernel matrices, which do not depend on (b, Lambda)."""

    inputs: Array
    outputs: Array
    parameters: VhgpParameters
    signal_kernel: RegularisableKernel
    noise_kernel: RegularisableKernel

    @classmethod
    def of(cls, inputs: Array, outputs: Array, parameters: VhgpParameters) -> VhgpProblem:
        """Build and factorise both kernel matrices of inputs (n, D)."""
        of_signal, of_noise = parameters.signal, parameters.noise
        signal = factorise(of_signal.matrix(inputs), smooth=of_signal.smooth)
        noise = factorise(of_noise.matrix(inputs), parameters.nugget, smooth=of_noise.smooth)
        return cls(inputs, outputs, parameters, signal, noise)


@dataclass(frozen=True)
class Sites:
    """q(g) as the prior times Gaussian sites of given precisions (Lambda) and potentials (precision times mean), (n,).

    They stay meaningful when the hyperparameters change, which the moments of q(g) do not.
    """

    precisions: Array
    potentials: Array

    def towards(self, other: Sites, step: float) -> Sites:
        """These sites for step 0, the target's for step 1, interpolated between."""
        precisions = self.precisions + step * (other.precisions - self.precisions)
        return Sites(precisions, self.potentials + step * (other.potentials - self.potentials))


@dataclass(frozen=True)
class SignalFit:
    """The signal given the noise: the parts of F and its derivatives that depend on f."""

    level: Array  # R
    ridge: Ridge
    alpha: Array  # (K_f + R)^-1 y
    log_likelihood: float  # log N(y | 0, K_f + R)

    @classmethod
    def of(cls, problem: VhgpProblem, noise_mean: Array, noise_variances: Array) -> SignalFit:
        """The signal for these moments of q(g). Raises LinAlgError or FloatingPointError where it is not finite."""
        with np.errstate(over="raise", invalid="raise"):
            level = np.exp(noise_mean - 0.5 * noise_variances)
        weights = 1.0 / (level + problem.parameters.jitter)
        ridge = problem.signal_kernel.regularise(weights)
        alpha = ridge.residual(weights * problem.outputs)
        fit = problem.outputs @ alpha + ridge.log_determinant + np.log(2.0 * np.pi / weights).sum()
        return cls(level, ridge, alpha, -0.5 * float(fit))

    def optimal_precisions(self, jitter: float) -> Array:
        """1/2 + dF/dm >= 0, shape (n,)."""
        jittered = self.level + jitter
        precision_diagonal = (1.0 - self.ridge.posterior_diagonal / jittered) / jittered
        return 0.5 * (self.level * (self.alpha**2 - precision_diagonal) + 1.0)


@dataclass(frozen=True)
class Bound:
    """F at one q(g), with the quantities that its derivatives share."""

    problem: VhgpProblem
    sites: Sites
    mean_weights: Array  # b
    noise_mean: Array  # m
    noise_variances: Array  # diagonal of S
    noise_ridge: Ridge
    signal: SignalFit
    value: float

    @classmethod
    def at(cls, problem: VhgpProblem, sites: Sites) -> Bound:
        """Evaluate F. Raises LinAlgError or FloatingPointError where it is not a finite number."""
        prior_mean = problem.parameters.noise_mean
        ridge = problem.noise_kernel.regularise(sites.precisions)
        variances = ridge.posterior_diagonal
        mean_weights = ridge.residual(sites.potentials - sites.precisions * prior_mean)
        deviation = problem.noise_kernel.times(mean_weights)
        signal = SignalFit.of(problem, prior_mean + deviation, variances)
        divergence = deviation @ mean_weights - sites.precisions @ variances + ridge.log_determinant
        value = signal.log_likelihood - 0.25 * float(variances.sum()) - 0.5 * float(divergence)
        if not np.isfinite(value):
            raise FloatingPointError("the variational bound is not finite")
        return cls(problem, sites, mean_weights, prior_mean + deviation, variances, ridge, signal, value)

    @classmethod
    def tied(cls, problem: VhgpProblem, site_precisions: Array) -> Bound:
        """F as a function of the site precisions alone, b = Lambda - 1/2."""
        mean_weights = site_precisions - 0.5
        mean = problem.parameters.noise_mean + problem.noise_kernel.times(mean_weights)
        return cls.at(problem, Sites(site_precisions, site_precisions * mean + mean_weights))

    @property
    def site_precisions(self) -> Array:
        """Lambda, shape (n,)."""
        return self.sites.precisions

    @property
    def noise_level(self) -> Array:
        """R, shape (n,)."""
        return self.signal.level

    @property
    def alpha(self) -> Array:
        """(K_f + R)^-1 y, shape (n,)."""
        return self.signal.alpha

    @cached_property
    def optimal_precisions(self) -> Array:
        """The site precisions that a fixed point reproduces, 1/2 + dF/dm >= 0, shape (n,)."""
        return self.signal.optimal_precisions(self.problem.parameters.jitter)

    @property
    def tied_precisions(self) -> Array:
        """Site precisions tied to these mean weights, with the same m; near a maximum those of `sites`."""
        return np.maximum(self.mean_weights + 0.5, _SMALLEST_PRECISION)

    @property
    def optimal_weights(self) -> Array:
        """The mean weights that a fixed point reproduces, dF/dm, shape (n,)."""
        return self.optimal_precisions - 0.5

    @property
    def optimal_sites(self) -> Sites:
        """The sites that a fixed point reproduces: where a step of natural gradient of length 1 ends."""
        return sites_from(self.optimal_precisions, self.noise_mean)

    def hyperparameter_gradient(self) -> Array:
        """dF/d(parameters.to_vector()) at fixed Lambda and b; at a maximum over these, that of the maximum."""
        signal = self._signal_gradient()
        noise = self._noise_gradient()
        of_noise, of_nugget = noise[: len(signal)], noise[len(signal) :]
        return np.concatenate([signal, of_noise, [self.optimal_weights.sum()], of_nugget])

    def _signal_gradient(self) -> Array:
        problem = self.problem
        weights = self.signal.ridge.upper_precision()
        _subtract_square(weights, self.alpha)
        jitter = -problem.parameters.jitter * float(np.trace(weights))
        gradient = -problem.parameters.signal.gradient(problem.inputs, problem.signal_kernel.matrix, weights)
        gradient[-1] += 2.0 * jitter
        return 0.5 * gradient

    def _noise_gradient(self) -> Array:
        problem = self.problem
        weights = self.noise_ridge.upper_precision()
        # b gb' + gb b' - b b' with gb the optimal weights, as one symmetric difference of squares
        _subtract_square(weights, self.optimal_weights)
        _subtract_square(weights, self.optimal_weights - self.mean_weights, -1.0)
        parameters, trace = problem.parameters, float(np.trace(weights))
        gradient = -0.5 * parameters.noise.gradient(problem.inputs, problem.noise_kernel.matrix, weights)
        return gradient if parameters.log_nugget_sd is None else np.append(gradient, -parameters.nugget * trace)


def sites_from(precisions: Array, noise_mean: Array) -> Sites:
    """The sites of optimal precisions for a mean m (n,) of q(g)."""
    return Sites(np.maximum(precisions, _SMALLEST_PRECISION), precisions * noise_mean + precisions - 0.5)


def _subtract_square(matrix: Array, vector: Array, sign: float = 1.0) -> None:
    """Subtract sign vector vector' from the upper triangle of a C-ordered matrix, in place."""
    scipy.linalg.blas.dsyr(-sign, vector, lower=1, a=matrix.T, overwrite_a=1)
