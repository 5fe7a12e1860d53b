# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Maximise the VHGP's bound over its hyperparameters, with q(g) solved for at every step.

Variable projection: L-BFGS sees the 2 D + 4 hyperparameters only. A joint search over them and Lambda ends in much
worse optima, towards the homoscedastic solution. No n x n matrix is kept from one evaluation to the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.bound import SignalFit, Sites, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.descent import Descent
from push_predictor.models.gaussian_process.gp import GpParameters
from push_predictor.models.gaussian_process.inner import maximise_over_noise
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.types import Array

# Logarithms, for inputs and outputs of unit spread; they keep line searches where the kernels are well conditioned.
_LENGTHSCALES = (np.log(1e-2), np.log(1e3))
_SIGNAL_SD = (np.log(1e-3), np.log(1e2))
_NOISE_SD = (np.log(1e-3), np.log(3.0))
_NOISE_MEAN = (np.log(1e-8), np.inf)  # open, see gp.py
_NUGGET_SD = (np.log(1e-3), np.log(3.0))
_REFUSED = 1e10
_SEARCH_TOLERANCE, _FINAL_TOLERANCE = 5e-2, 2e-2  # nats
_FAR = 10.0  # by this factor the first evaluation, far from the maximum, is less accurate
_STOP = 3e-4  # relative decrease: a tenth of a nat for MOST_SEARCHED rows

# Gaussian priors on the logarithms. Without them the bound of 100 rows often peaks at far too confident a noise model,
# or at a homoscedastic one. The signal stays near the homoscedastic fit, the noise varies by a factor of exp(0.67) over
# half an input's spread. For any number of rows the prior of g's lengthscales is as strong as for a hundred: windows of
# one push are not independent, and with many of them the bound takes differences between pushes for noise that varies
# over short lengths, and is overconfident between the pushes. Bounds of 1000 rows outweigh the other priors.
NOISE_LENGTHSCALE, NOISE_LENGTHSCALE_SPREAD = -0.7, 0.5
NOISE_LOG_SD, LOG_NUGGET_SD, SPREAD = -0.4, -1.0, 0.3
FEW_ROWS = 100


def maximise_bound(
    inputs: Array, outputs: Array, near: GpParameters, most_iterations: int, shortest: float
) -> tuple[VhgpParameters, Array]:
    """Hyperparameters where the bound plus the log prior is highest, and the site precisions (n,), tied to them.

    near: a homoscedastic fit of these rows or some of them, where the search starts. shortest: lengthscale of the
    signal. Raises TrainingError if the bound is not finite at any point of the search.
    """
    d, n = inputs.shape[1], len(outputs)
    box = _box(d, shortest)
    centre = np.clip(_prior_centre(near).to_vector(), *box.T)
    search = Search(partial(VhgpProblem.of, inputs, outputs), Prior(centre, _spread(d, n)), _SEARCH_TOLERANCE)
    Descent(box, most_iterations, _STOP).run(search.cost, centre)
    return search.solved(_FINAL_TOLERANCE)


def precisions_from(problem: VhgpProblem, noise: LatentPrediction) -> Array:
    """Site precisions (n,) for these hyperparameters and rows; noise: g at the rows as a fit of some predicts it."""
    return maximise_over_noise(problem, _sites(problem, noise), _FINAL_TOLERANCE).tied_precisions


def _sites(problem: VhgpProblem, noise: LatentPrediction) -> Sites:
    mean = noise.log_noise_mean
    return Sites.optimal(SignalFit.of(problem, mean, noise.log_noise_variance).optimal_precisions, mean)


def _box(d: int, shortest: float) -> Array:
    signal = [(np.log(shortest), _LENGTHSCALES[1])] * d + [_SIGNAL_SD]
    return np.array(signal + [_LENGTHSCALES] * d + [_NOISE_SD, _NOISE_MEAN, _NUGGET_SD])


def _prior_centre(gp: GpParameters) -> VhgpParameters:
    noise_lengthscales = np.full(len(gp.log_lengthscales), NOISE_LENGTHSCALE)
    # so that the mean of exp(g) is the homoscedastic noise variance
    noise_mean = 2.0 * gp.log_noise_sd - 0.5 * float(np.exp(2.0 * NOISE_LOG_SD))
    noise = noise_lengthscales, NOISE_LOG_SD, noise_mean, LOG_NUGGET_SD
    return VhgpParameters(gp.log_lengthscales, gp.log_signal_sd, *noise)


def _spread(d: int, n: int) -> Array:
    spread = np.full(2 * d + 4, SPREAD)
    spread[d + 1 : 2 * d + 1] = NOISE_LENGTHSCALE_SPREAD * np.sqrt(min(1.0, FEW_ROWS / n))
    return spread


@dataclass(frozen=True)
class Prior:
    """Independent Gaussians of the hyperparameters' logarithms; spread infinity: none."""

    centre: Array
    spread: Array

    def penalty(self, vector: Array) -> tuple[float, Array]:
        """Minus the log density up to a constant, and its gradient."""
        deviation = (vector - self.centre) / self.spread
        return 0.5 * float(deviation @ deviation), deviation / self.spread


@dataclass(frozen=True, eq=False)
class Found:
    """A point of a search: enough to evaluate the bound there again, without large matrices."""

    parameters: VhgpParameters
    sites: Sites
    cost: float


class Search:
    """The cost for L-BFGS: minus the bound and the log prior. q(g) is solved for from that of `best`, the lowest point.

    problem_of: the rows' problem for hyperparameters. tolerance: of the bound, nats.
    """

    def __init__(self, problem_of: Callable[[VhgpParameters], VhgpProblem], prior: Prior, tolerance: float) -> None:
        self.problem_of, self.prior, self.tolerance = problem_of, prior, tolerance
        self.best: Found | None = None

    def cost(self, vector: Array) -> tuple[float, Array]:
        """The cost at hyperparameters `vector`, and its gradient."""
        parameters = VhgpParameters.from_vector(vector)
        penalty, slope = self.prior.penalty(vector)
        try:
            problem = self.problem_of(parameters)
            goal = penalty - self.best.cost if self.best else None
            tolerance = self.tolerance if self.best else _FAR * self.tolerance
            bound = maximise_over_noise(problem, self.best.sites if self.best else None, tolerance, goal=goal)
        except (np.linalg.LinAlgError, FloatingPointError):
            return _REFUSED, np.zeros_like(vector)
        cost = penalty - bound.value
        if self.best is None or cost < self.best.cost:
            self.best = Found(parameters, bound.sites, cost)
        return cost, slope - bound.hyperparameter_gradient()

    def solved(self, tolerance: float) -> tuple[VhgpParameters, Array]:
        """The best hyperparameters, and the site precisions tied to them. Raises TrainingError if there are none."""
        if self.best is None:
            raise TrainingError("the variational bound is not finite at any hyperparameters")
        parameters, sites = self.best.parameters, self.best.sites
        return parameters, maximise_over_noise(self.problem_of(parameters), sites, tolerance).tied_precisions
