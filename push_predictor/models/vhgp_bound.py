"""The variational bound of a VHGP and its derivatives (Lazaro-Gredilla and Titsias 2011, eq. 7; docs/errata.md).

    F = log N(y | 0, K_f + R) - 1/4 tr S - KL(N(m, S) || N(mu0, K_g)),     R_ii = exp(m_i - S_ii / 2)
    S^-1 = K_g^-1 + Lambda,     m = mu0 + K_g b,     Lambda diagonal ("site precisions"), b ("mean weights")

At a maximum over (b, Lambda) the two are tied, b = Lambda - 1/2, which leaves one number per training row.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.kernels import SquaredExponential
from push_predictor.models.ridge import RegularisableKernel, Ridge, factorise
from push_predictor.types import Array

JITTER = 1e-6  # of the signal variance, on the diagonal of K_f


@dataclass(frozen=True)
class VhgpParameters:
    """Hyperparameters: ARD kernel of the signal f, ARD kernel of the log noise variance g, prior mean of g."""

    log_lengthscales: Array
    log_signal_sd: float
    noise_log_lengthscales: Array
    noise_log_sd: float
    noise_mean: float

    @property
    def signal(self) -> SquaredExponential:
        """Kernel of f."""
        return SquaredExponential(self.log_lengthscales, self.log_signal_sd)

    @property
    def noise(self) -> SquaredExponential:
        """Kernel of g."""
        return SquaredExponential(self.noise_log_lengthscales, self.noise_log_sd)

    @property
    def jitter(self) -> float:
        """What is added to the diagonal of K_f."""
        return JITTER * self.signal.variance

    def to_vector(self) -> Array:
        """The fields in their order, shape (2 D + 3,)."""
        signal = np.append(self.log_lengthscales, self.log_signal_sd)
        return np.concatenate([signal, self.noise_log_lengthscales, [self.noise_log_sd, self.noise_mean]])

    @classmethod
    def from_vector(cls, vector: Array) -> VhgpParameters:
        """The inverse of `to_vector`."""
        d = (len(vector) - 3) // 2
        noise_sd, noise_mean = float(vector[-2]), float(vector[-1])
        return cls(vector[:d], float(vector[d]), vector[d + 1 : -2], noise_sd, noise_mean)


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
        signal = factorise(parameters.signal.matrix(inputs))
        noise = factorise(parameters.noise.matrix(inputs))
        return cls(inputs, outputs, parameters, signal, noise)


@dataclass(frozen=True)
class Bound:
    """F at one q(g), with what the derivatives share.

    q(g) is the prior times Gaussian sites of given precisions (Lambda) and potentials (precision times mean).
    The sites stay meaningful when the hyperparameters change, which the moments of q(g) do not.
    """

    problem: VhgpProblem
    site_precisions: Array
    site_potentials: Array
    mean_weights: Array  # b
    noise_mean: Array  # m
    noise_variances: Array  # diagonal of S
    noise_ridge: Ridge
    noise_level: Array  # R
    signal_ridge: Ridge
    alpha: Array  # (K_f + R)^-1 y
    value: float

    @classmethod
    def at(cls, problem: VhgpProblem, site_precisions: Array, site_potentials: Array) -> Bound:
        """Evaluate F. Raises LinAlgError or FloatingPointError where it is not a finite number."""
        parameters = problem.parameters
        noise_ridge = problem.noise_kernel.regularise(site_precisions)
        variances = noise_ridge.posterior_diagonal
        mean_weights = noise_ridge.residual(site_potentials - site_precisions * parameters.noise_mean)
        deviation = problem.noise_kernel.matrix @ mean_weights
        with np.errstate(over="raise", invalid="raise"):
            level = np.exp(parameters.noise_mean + deviation - 0.5 * variances)
        weights = 1.0 / (level + parameters.jitter)
        signal_ridge = problem.signal_kernel.regularise(weights)
        alpha = signal_ridge.residual(weights * problem.outputs)
        fit = problem.outputs @ alpha + signal_ridge.log_determinant + np.log(2.0 * np.pi / weights).sum()
        divergence = deviation @ mean_weights - site_precisions @ variances + noise_ridge.log_determinant
        value = -0.5 * float(fit + 0.5 * variances.sum() + divergence)
        if not np.isfinite(value):
            raise FloatingPointError("the variational bound is not finite")
        return cls(problem, site_precisions, site_potentials, mean_weights, parameters.noise_mean + deviation,
                   variances, noise_ridge, level, signal_ridge, alpha, value)  # fmt: skip

    @classmethod
    def tied(cls, problem: VhgpProblem, site_precisions: Array) -> Bound:
        """F as a function of the site precisions alone, b = Lambda - 1/2."""
        mean_weights = site_precisions - 0.5
        mean = problem.parameters.noise_mean + problem.noise_kernel.matrix @ mean_weights
        return cls.at(problem, site_precisions, site_precisions * mean + mean_weights)

    @cached_property
    def optimal_precisions(self) -> Array:
        """The site precisions that a fixed point reproduces, 1/2 + dF/dm >= 0, shape (n,)."""
        jittered = self.noise_level + self.problem.parameters.jitter
        precision_diagonal = (1.0 - self.signal_ridge.posterior_diagonal / jittered) / jittered
        return 0.5 * (self.noise_level * (self.alpha**2 - precision_diagonal) + 1.0)

    @property
    def optimal_weights(self) -> Array:
        """The mean weights that a fixed point reproduces, dF/dm, shape (n,)."""
        return self.optimal_precisions - 0.5

    def hyperparameter_gradient(self, tied: bool = False) -> Array:
        """dF/d(parameters.to_vector()) at fixed Lambda and b, or with b = Lambda - 1/2 held to it (`tied`).

        Both agree at a maximum over (b, Lambda). The untied form leaves out a term that vanishes there and
        costs a product of two (n, n) matrices.
        """
        signal = self._signal_gradient()
        noise = self._noise_gradient(tied)
        return np.concatenate([signal, noise, [self.optimal_weights.sum()]])

    def _signal_gradient(self) -> Array:
        problem = self.problem
        weights = -self.signal_ridge.precision()
        weights += np.outer(self.alpha, self.alpha)
        jitter = problem.parameters.jitter * np.trace(weights)
        gradient = problem.parameters.signal.gradient(problem.inputs, problem.signal_kernel.matrix, weights)
        gradient[-1] += 2.0 * jitter
        return 0.5 * gradient

    def _noise_gradient(self, complete: bool) -> Array:
        problem = self.problem
        precision = self.noise_ridge.precision()
        # b gb' + gb b' - b b' with gb the optimal weights, as one symmetric difference of squares
        weights = np.outer(self.optimal_weights, self.optimal_weights) - precision
        excess = self.optimal_weights - self.mean_weights
        weights -= np.outer(excess, excess)
        if complete:
            unbalance = (self.optimal_precisions - self.site_precisions) / self.site_precisions**2
            weights -= (precision * unbalance) @ precision
        return 0.5 * problem.parameters.noise.gradient(problem.inputs, problem.noise_kernel.matrix, weights)

    def site_gradient(self) -> Array:
        """dF/dLambda with b = Lambda - 1/2 tied to it: -(K_g + 1/2 S o S)(Lambda - optimal), shape (n,)."""
        kernel = self.problem.noise_kernel.matrix
        posterior = kernel - kernel @ self.noise_ridge.precision() @ kernel
        return -(kernel + 0.5 * posterior**2) @ (self.site_precisions - self.optimal_precisions)


def bound_and_gradient(
    inputs: Array, outputs: Array, parameters: VhgpParameters, site_precisions: Array
) -> tuple[float, Array, Array]:
    """F with b = Lambda - 1/2, dF/d(site_precisions) (n,) and dF/d(parameters.to_vector()) (2 D + 3,)."""
    problem = VhgpProblem.of(inputs, outputs, parameters)
    bound = Bound.tied(problem, site_precisions)
    return bound.value, bound.site_gradient(), bound.hyperparameter_gradient(tied=True)
