# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The variational bound of a VHGP and its derivatives (Lazaro-Gredilla and Titsias 2011, equation 7).

Where the printed equations differ from these: docs/explanation/errata.md.

    F = log N(y | 0, K_f + R) - 1/4 tr S - KL(N(m, S) || N(mu0, K_g)),     R_ii = exp(m_i - S_ii / 2)
    S^-1 = K_g^-1 + Lambda,     m = mu0 + K_g b,     Lambda diagonal ("site precisions"), b ("mean weights")

K_g includes the nugget, but no matrix does: with it none has low rank. At a maximum over (b, Lambda) the two are tied,
b = Lambda - 1/2, which leaves one number per training row.

With inducing inputs for f and g (inducing.py; derived in docs/explanation/sparse.md), Q_f and Q_g replace K_f and
K_g. The variances c that they do not explain add -1/2 sum_i c_f,i / R_ii, and c_g to the variances S_ii. If every row
is an inducing input, the two bounds are equal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.gaussian_process.gp import Kernel, Likelihood, Ridge
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.ridge import DenseKernel
from push_predictor.types import Array, IntArray

JITTER = 1e-6  # of the signal variance, on the diagonal of K_f
_SMALLEST_PRECISION = 1e-7  # below it S loses its precision
_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class VhgpParameters:
    """Hyperparameters: ARD kernel of the signal f, ARD kernel of the log noise variance g, prior mean of g.

    log_nugget_sd: log of the standard deviation of g's nugget, which is independent from row to row.
    """

    log_lengthscales: Array
    log_signal_sd: float
    noise_log_lengthscales: Array
    noise_log_sd: float
    noise_mean: float
    log_nugget_sd: float

    @property
    def count(self) -> int:
        """Number of hyperparameters."""
        return 2 * len(self.log_lengthscales) + 4

    @cached_property
    def signal(self) -> ArdKernel:
        """Kernel of f."""
        return ArdKernel(self.log_lengthscales, self.log_signal_sd)

    @cached_property
    def noise(self) -> ArdKernel:
        """Kernel of g, without its nugget."""
        return ArdKernel(self.noise_log_lengthscales, self.noise_log_sd)

    @cached_property
    def nugget(self) -> float:
        """What is added to the diagonal of K_g, and to the variance of g at any input."""
        return float(np.exp(2.0 * self.log_nugget_sd))

    @cached_property
    def jitter(self) -> float:
        """What is added to the diagonal of K_f."""
        return JITTER * self.signal.variance

    def to_vector(self) -> Array:
        """The numbers in their order, shape (2 D + 4,)."""
        signal = np.append(self.log_lengthscales, self.log_signal_sd)
        rest = [self.noise_log_sd, self.noise_mean, self.log_nugget_sd]
        return np.concatenate([signal, self.noise_log_lengthscales, rest])

    @classmethod
    def from_vector(cls, vector: Array) -> VhgpParameters:
        """The inverse of `to_vector`."""
        d = (len(vector) - 4) // 2
        return cls(vector[:d], float(vector[d]), vector[d + 1 : -3], *(float(value) for value in vector[-3:]))


@dataclass(frozen=True, eq=False)
class VhgpProblem:
    """Training outputs (n,) and hyperparameters with the two kernels, which do not depend on (b, Lambda)."""

    outputs: Array
    parameters: VhgpParameters
    signal: Kernel
    noise: Kernel  # without the nugget

    @classmethod
    def of(cls, inputs: Array, outputs: Array, parameters: VhgpParameters) -> VhgpProblem:
        """Both kernels of inputs (n, D)."""
        return cls(
            outputs, parameters, *(DenseKernel(kernel, inputs) for kernel in (parameters.signal, parameters.noise))
        )

    def noise_times(self, vector: Array) -> Array:
        """K_g vector, shape (n,)."""
        return self.noise.times(vector) + self.parameters.nugget * vector


@dataclass(frozen=True, eq=False)
class Sites:
    """q(g) as the prior times Gaussian sites of given precisions (Lambda) and potentials (precision times mean), (n,).

    They stay meaningful when the hyperparameters change, which the moments of q(g) do not.
    """

    precisions: Array
    potentials: Array

    @classmethod
    def optimal(cls, precisions: Array, noise_mean: Array) -> Sites:
        """The sites of optimal precisions for a mean m (n,) of q(g)."""
        return cls(np.maximum(precisions, _SMALLEST_PRECISION), precisions * noise_mean + precisions - 0.5)

    def towards(self, other: Sites, step: float) -> Sites:
        """These sites for step 0, the target's for step 1, interpolated between."""
        precisions = self.precisions + step * (other.precisions - self.precisions)
        return Sites(precisions, self.potentials + step * (other.potentials - self.potentials))


@dataclass(frozen=True, eq=False)
class SignalFit:
    """The signal given the noise: the parts of F and its derivatives that depend on f."""

    level: Array  # R
    likelihood: Likelihood

    @classmethod
    def of(cls, problem: VhgpProblem, noise_mean: Array, noise_variances: Array) -> SignalFit:
        """The signal for these moments of q(g). Raises LinAlgError or FloatingPointError where it is not finite."""
        with np.errstate(over="raise", invalid="raise"):
            level = np.exp(noise_mean - 0.5 * noise_variances)
            noise = level + problem.parameters.jitter
            return cls(level, Likelihood.of(problem.signal, problem.outputs, noise))

    @cached_property
    def optimal_precisions(self) -> Array:
        """The site precisions that a fixed point reproduces, 1/2 + dF/dm >= 0, shape (n,)."""
        return self.level * self.likelihood.slopes + 0.5


@dataclass(frozen=True, eq=False)
class Bound:
    """F at one q(g), with the quantities that its derivatives share."""

    problem: VhgpProblem
    sites: Sites
    mean_weights: Array  # b
    noise_mean: Array  # m
    noise_ridge: Ridge  # of g without its nugget, which is noise to it: D = 1 / Lambda + nugget
    signal: SignalFit
    value: float

    @classmethod
    def at(cls, problem: VhgpProblem, sites: Sites) -> Bound:
        """Evaluate F. Raises LinAlgError or FloatingPointError where it is not a finite number."""
        precisions, prior_mean, nugget = sites.precisions, problem.parameters.noise_mean, problem.parameters.nugget
        ridge = problem.noise.regularise(precisions / (1.0 + nugget * precisions))
        share = ridge.weights / precisions
        explained = share * (nugget + share * ridge.posterior_diagonal)
        variances = explained + problem.noise.unexplained
        mean_weights = ridge.residual(share * (sites.potentials - precisions * prior_mean))
        deviation = problem.noise_times(mean_weights)
        signal = SignalFit.of(problem, prior_mean + deviation, variances)
        divergence = deviation @ mean_weights - precisions @ explained + ridge.log_determinant - np.log(share).sum()
        value = signal.likelihood.value - 0.25 * float(variances.sum()) - 0.5 * float(divergence)
        if not np.isfinite(value):
            raise FloatingPointError("the variational bound is not finite")
        return cls(problem, sites, mean_weights, prior_mean + deviation, ridge, signal, value)

    @classmethod
    def tied(cls, problem: VhgpProblem, site_precisions: Array) -> Bound:
        """F as a function of the site precisions alone, b = Lambda - 1/2."""
        mean_weights = site_precisions - 0.5
        mean = problem.parameters.noise_mean + problem.noise_times(mean_weights)
        return cls.at(problem, Sites(site_precisions, site_precisions * mean + mean_weights))

    @property
    def tied_precisions(self) -> Array:
        """Site precisions tied to these mean weights, with the same m; near a maximum those of `sites`."""
        return np.maximum(self.mean_weights + 0.5, _SMALLEST_PRECISION)

    @property
    def optimal_sites(self) -> Sites:
        """The sites that a fixed point reproduces: where a step of natural gradient of length 1 ends."""
        return Sites.optimal(self.signal.optimal_precisions, self.noise_mean)

    def hyperparameter_gradient(self) -> Array:
        """dF/d(parameters.to_vector()) at fixed Lambda and b; at a maximum over these, that of the maximum."""
        signal = self.signal.likelihood.gradient()
        signal[-1] += 2.0 * self.problem.parameters.jitter * float(self.signal.likelihood.slopes.sum())
        # dF/dm = gb gives b gb' + gb b' - b b', as one difference of squares
        optimal, ridge = self.signal.optimal_precisions - 0.5, self.noise_ridge
        removed = optimal - self.mean_weights
        noise = ridge.gradient(optimal, removed, self.sites.precisions)
        precision = ridge.weights - ridge.posterior_diagonal * ridge.weights**2
        by_nugget = self.problem.parameters.nugget * float((optimal**2 - removed**2 - precision).sum())
        return np.concatenate([signal, noise, [optimal.sum(), by_nugget]])

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n rows from the rows of all other blocks (n,), from these factorisations.

        The signal is seen through R, the log noise variance through the sites, whose values are m + b / Lambda. R and
        the sites of the other rows are kept: refitting them without the block changes them little, and takes forty
        times as long (Vehtari et al. 2016, "Bayesian leave-one-out cross-validation approximations for Gaussian latent
        variable models").
        """
        problem, parameters = self.problem, self.problem.parameters
        errors, variance = self.signal.likelihood.ridge.held_out_errors(self.signal.likelihood.alpha, block)
        of_noise, noise_variance = self.noise_ridge.held_out_errors(self.mean_weights, block)
        site_variance = 1.0 / self.sites.precisions
        noise_variance = noise_variance + problem.noise.unexplained - site_variance
        return LatentPrediction(
            problem.outputs - errors,
            np.maximum(variance + problem.signal.unexplained - self.signal.level, parameters.jitter),
            self.noise_mean + self.mean_weights * site_variance - of_noise,
            np.maximum(noise_variance, parameters.nugget + _EPSILON * parameters.noise.variance),
        )
