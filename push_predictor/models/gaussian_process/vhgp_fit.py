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

"""Maximise the VHGP's bound over its hyperparameters, with q(g) solved for at every step.

Variable projection: L-BFGS sees the 2 D + 3 hyperparameters (and the nugget) only. A joint search over them and Lambda
ends in much worse optima, towards the homoscedastic solution. With many rows the search is coarse to fine, see
descent.py. No n x n matrix is kept from one evaluation to the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.descent import Descent, part_of_rows
from push_predictor.models.gaussian_process.gp import GpParameters
from push_predictor.models.gaussian_process.kernels import KernelChoice
from push_predictor.models.gaussian_process.vhgp_bound import Bound, SignalFit, Sites, VhgpProblem, sites_from
from push_predictor.models.gaussian_process.vhgp_inner import maximise_over_noise
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.types import Array

# Logarithms, for inputs and outputs of unit spread; they keep line searches where the kernels are well conditioned.
_LENGTHSCALES = (np.log(1e-2), np.log(1e3))
_SIGNAL_SD = (np.log(1e-3), np.log(1e2))
_NOISE_SD = (np.log(1e-3), np.log(3.0))
_NOISE_MEAN = (np.log(1e-8), np.inf)  # open, see gp.py
_NUGGET_SD = (np.log(1e-3), np.log(3.0))
_REFUSED = 1e10
_SEARCH_TOLERANCE = 5e-2  # nats
_FIRST_TOLERANCE = 0.5  # far from the maximum
_FINAL_TOLERANCE = 2e-2
_STOP = 1e-4

# Gaussian priors on the logarithms. Without them the bound of 100 rows often peaks at far too confident a noise model,
# or at a homoscedastic one. The signal stays near the homoscedastic fit, the noise varies by a factor of exp(0.67) over
# half an input's spread. For any number of rows the prior of g's lengthscales is as strong as for a hundred, as in
# sparse/fit.py: windows of one push are not independent, and with many of them the bound takes differences between
# pushes for noise that varies over short lengths. Bounds of 1000 rows outweigh the other priors.
_NOISE_LENGTHSCALE, _NOISE_LENGTHSCALE_SPREAD = -0.7, 0.5
_NOISE_LOG_SD = -0.4
_LOG_NUGGET_SD = -1.0
_SPREAD = 0.3
_FEW_ROWS = 100


def maximise_bound(
    inputs: Array, outputs: Array, near: GpParameters, choice: KernelChoice, most_iterations: int, shortest: float
) -> tuple[VhgpParameters, Array]:
    """Hyperparameters where the bound plus the log prior is highest, and the site precisions (n,), tied to them.

    near: the homoscedastic fit of the same rows, where the search starts. shortest: lengthscale of the signal. Raises
    TrainingError if the bound is not finite at any point of the search.
    """
    box = _box(inputs.shape[1], choice, shortest)
    descent = Descent(box, most_iterations, _STOP)
    centre = np.clip(_prior_centre(near, choice).to_vector(), *box.T)
    search, rows = _Search(inputs, outputs, choice, centre), part_of_rows(len(outputs))
    if rows is None:
        descent.run(search.cost, centre)
    else:
        rough = _Search(inputs[rows], outputs[rows], choice, centre)
        minimum = descent.run(rough.cost, centre)
        search.rough = rough.best
        descent.refine(search.cost, minimum)
    if search.best is None:
        raise TrainingError(f"the variational bound of {len(outputs)} rows is not finite anywhere")
    parameters, sites = search.best.parameters, search.best.sites
    bound = maximise_over_noise(VhgpProblem.of(inputs, outputs, parameters), sites, _FINAL_TOLERANCE)
    return parameters, bound.tied_precisions


def _box(d: int, choice: KernelChoice, shortest: float) -> Array:
    box = [(np.log(shortest), _LENGTHSCALES[1])] * d + [_SIGNAL_SD] + [_LENGTHSCALES] * d + [_NOISE_SD, _NOISE_MEAN]
    return np.array(box + [_NUGGET_SD] * choice.noise_nugget)


def _prior_centre(gp: GpParameters, choice: KernelChoice) -> VhgpParameters:
    noise_lengthscales = np.full(len(gp.log_lengthscales), _NOISE_LENGTHSCALE)
    # so that the mean of exp(g) is the homoscedastic noise variance
    noise_mean = 2.0 * gp.log_noise_sd - 0.5 * float(np.exp(2.0 * _NOISE_LOG_SD))
    nugget = _LOG_NUGGET_SD if choice.noise_nugget else None
    return VhgpParameters(
        gp.log_lengthscales, gp.log_signal_sd, noise_lengthscales, _NOISE_LOG_SD, noise_mean, choice.family, nugget
    )


def _spread(d: int, choice: KernelChoice, n: int) -> Array:
    spread = np.full(2 * d + 3 + choice.noise_nugget, _SPREAD)
    spread[d + 1 : 2 * d + 1] = _NOISE_LENGTHSCALE_SPREAD
    spread[d + 1 : 2 * d + 1] *= np.sqrt(min(1.0, _FEW_ROWS / n))
    return spread


@dataclass(frozen=True)
class _Prior:
    """Independent Gaussians of the hyperparameters' logarithms."""

    centre: Array
    spread: Array

    def penalty(self, vector: Array) -> tuple[float, Array]:
        """Minus the log density up to a constant, and its gradient."""
        deviation = (vector - self.centre) / self.spread
        return 0.5 * float(deviation @ deviation), deviation / self.spread


@dataclass(frozen=True)
class _Found:
    """The best point of a search: enough to evaluate the bound there again, without large matrices."""

    inputs: Array
    outputs: Array
    parameters: VhgpParameters
    sites: Sites
    cost: float

    def sites_of(self, problem: VhgpProblem) -> Sites:
        """Sites for other rows, predicted from the noise of these rows at the same hyperparameters."""
        parameters = self.parameters
        bound = Bound.at(VhgpProblem.of(self.inputs, self.outputs, parameters), self.sites)
        cross = parameters.noise.cross(problem.inputs, self.inputs)
        mean = parameters.noise_mean + cross @ bound.mean_weights
        explained = np.einsum("ij,ij->i", cross @ bound.noise_ridge.precision(), cross)
        signal = SignalFit.of(problem, mean, parameters.noise.variance + parameters.nugget - explained)
        return sites_from(signal.optimal_precisions(parameters.jitter), mean)


class _Search:
    """The cost for L-BFGS. best: its lowest point so far; rough: that of other rows. q(g) is solved from these."""

    def __init__(self, inputs: Array, outputs: Array, choice: KernelChoice, centre: Array) -> None:
        self.inputs, self.outputs, self.choice = inputs, outputs, choice
        self.prior = _Prior(centre, _spread(inputs.shape[1], choice, len(outputs)))
        self.rough: _Found | None = None
        self.best: _Found | None = None

    def cost(self, vector: Array) -> tuple[float, Array]:
        """Minus the bound and the log prior, and its gradient."""
        parameters = VhgpParameters.from_vector(vector, self.choice)
        penalty, slope = self.prior.penalty(vector)
        try:
            problem = VhgpProblem.of(self.inputs, self.outputs, parameters)
            goal = penalty - self.best.cost if self.best else None
            tolerance = _SEARCH_TOLERANCE if self.best else _FIRST_TOLERANCE
            bound = maximise_over_noise(problem, self._start(problem), tolerance, goal=goal)
        except (np.linalg.LinAlgError, FloatingPointError):
            return _REFUSED, np.zeros_like(vector)
        cost = penalty - bound.value
        if self.best is None or cost < self.best.cost:
            self.best = _Found(self.inputs, self.outputs, parameters, bound.sites, cost)
        return cost, slope - bound.hyperparameter_gradient()

    def _start(self, problem: VhgpProblem) -> Sites | None:
        if self.best is not None:
            return self.best.sites
        return self.rough.sites_of(problem) if self.rough else None
