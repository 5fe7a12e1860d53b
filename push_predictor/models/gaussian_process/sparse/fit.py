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

"""Fit of a sparse VHGP, coarse to fine: a dense VHGP of few rows, then the sparse bound of more rows, then of all.

Each stage chooses the inducing inputs by the hyperparameters of the stage before and keeps them. L-BFGS searches the
hyperparameters, and q(g) is solved for at every step, as in vhgp_fit.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.descent import Descent
from push_predictor.models.gaussian_process.gp import check_rows
from push_predictor.models.gaussian_process.sparse.bound import SparseBound, SparseProblem, SparseSignal
from push_predictor.models.gaussian_process.sparse.inducing import inducing_rows
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.models.gaussian_process.vhgp_bound import Sites, sites_from
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.types import Array, IntArray

DEFAULT_INDUCING = 100

_DENSE_ROWS = 500
_MIDDLE_ROWS = 5000
_MOST_ITERATIONS = 20
_SEARCH_TOLERANCE, _FINAL_TOLERANCE, _STOP = 4e-6, 1e-7, 1e-5  # nats a row
_MOST_STEPS = 30
_SHORTEST_STEP = 1.0 / 64.0
_REFUSED = 1e10
_REACH = np.log(30.0)  # by this factor a hyperparameter may change in a stage
# Gaussian priors of the logarithms of g's lengthscales and standard deviation: those of vhgp_fit.py, as strong for any
# number of rows as they are for a hundred. Windows of one push are not independent: with many of them the bound
# takes differences between pushes for noise that varies over short lengths, and is overconfident between the pushes.
_LENGTHSCALE, _LENGTHSCALE_SPREAD = -0.7, 0.5
_SD, _SD_SPREAD = -0.4, 0.3
_PRIOR_WEIGHT = 0.01  # a row
_UNIT = 0.1  # of the logarithms: about the length of the first step


def fit_sparse_vhgp(inputs: Array, outputs: Array, most_inducing: int = DEFAULT_INDUCING) -> SparseVHGP:
    """Maximise the sparse bound over hyperparameters and q(g); squared exponential kernels, no nugget.

    inputs (n, D) and outputs (n,) standardised; most_inducing: of f, and of g. The same rows give the same model.
    Raises TrainingError when the rows do not match, are not finite, or the bound is not finite anywhere.
    """
    check_rows(inputs, outputs)
    order = np.random.default_rng(0).permutation(len(outputs))
    few = np.sort(order[:_DENSE_ROWS])
    coarse = fit_vhgp(inputs[few], outputs[few])
    more = np.sort(order[:_MIDDLE_ROWS])
    return _refined(_refined(coarse, inputs[more], outputs[more], most_inducing), inputs, outputs, most_inducing)


def maximise_over_noise(problem: SparseProblem, starts: Sequence[Sites], tolerance: float) -> SparseBound:
    """The bound at its maximum over q(g), found to `tolerance` nats, by steps of natural gradient (vhgp_inner.py).

    It begins at the best of the starts, or at fresh sites if there is none. Raises LinAlgError or FloatingPointError if
    the bound is not finite even there.
    """
    bounds = [bound for sites in starts if (bound := _bound_at(problem, sites))]
    bound = max(bounds, key=lambda found: found.value) if bounds else SparseBound.at(problem, fresh_sites(problem))
    for _ in range(_MOST_STEPS):
        better = _improved(problem, bound, tolerance)
        if better is None:
            return bound
        gained, bound = better.value - bound.value, better
        if gained < tolerance:
            return bound
    return bound


def fresh_sites(problem: SparseProblem) -> Sites:
    """Sites of precision 1/2 that leave the mean of g at its prior."""
    half = np.full(len(problem.outputs), 0.5)
    return Sites(half, half * problem.parameters.noise_mean)


def _improved(problem: SparseProblem, bound: SparseBound, tolerance: float) -> SparseBound | None:
    """The bound after the longest step of 1, 1/2, 1/4 ... that does not lower it."""
    step, target = 1.0, bound.optimal_sites
    while step >= _SHORTEST_STEP:
        candidate = _bound_at(problem, bound.sites.towards(target, step))
        if candidate is not None and candidate.value >= bound.value - 1e-3 * tolerance:
            return candidate
        step *= 0.5
    return None


def _bound_at(problem: SparseProblem, sites: Sites) -> SparseBound | None:
    try:
        return SparseBound.at(problem, sites)
    except (np.linalg.LinAlgError, FloatingPointError):
        return None


def _refined(rough: VHGP | SparseVHGP, inputs: Array, outputs: Array, most_inducing: int) -> SparseVHGP:
    """The model of these rows, starting from a model of some of them."""
    parameters = rough.parameters
    chosen = tuple(inducing_rows(kernel, inputs, most_inducing) for kernel in (parameters.signal, parameters.noise))
    search = _Search(inputs, outputs, chosen, rough)
    first = parameters.to_vector()
    box = np.column_stack([first - _REACH, first + _REACH])
    box[-1, 1] = np.inf  # one open side, see gp.py
    Descent(box / _UNIT, _MOST_ITERATIONS, _STOP).run(search.cost, first / _UNIT)
    best = search.best
    if best is None:
        raise TrainingError(f"the variational bound of {len(outputs)} rows is not finite anywhere")
    try:
        bound = maximise_over_noise(search.problem(best.parameters), [best.sites], _FINAL_TOLERANCE * len(outputs))
        return SparseVHGP(inputs, outputs, best.parameters, bound.tied_precisions, *chosen)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        raise TrainingError(f"no sparse VHGP of {len(outputs)} rows was found: {error}") from None


@dataclass(frozen=True, eq=False)
class _Found:
    parameters: VhgpParameters
    sites: Sites
    cost: float


class _Search:
    """The cost for L-BFGS: minus bound and log prior, in nats. best: its lowest point so far."""

    def __init__(self, inputs: Array, outputs: Array, chosen: Sequence[IntArray], rough: VHGP | SparseVHGP) -> None:
        self.inputs, self.outputs, self.rough = inputs, outputs, rough
        self.of_signal, self.of_noise = (inputs[rows] for rows in chosen)
        self.best: _Found | None = None

    def problem(self, parameters: VhgpParameters) -> SparseProblem:
        return SparseProblem.of(self.inputs, self.outputs, parameters, self.of_signal, self.of_noise)

    def cost(self, point: Array) -> tuple[float, Array]:
        parameters, n = VhgpParameters.from_vector(point * _UNIT), len(self.outputs)
        try:
            problem = self.problem(parameters)
            bound = maximise_over_noise(problem, self._starts(problem), _SEARCH_TOLERANCE * n)
        except (np.linalg.LinAlgError, FloatingPointError):
            return _REFUSED, np.zeros_like(point)
        penalty, slope = noise_penalty(point * _UNIT, n)
        cost = penalty - bound.value
        if self.best is None or cost < self.best.cost:
            self.best = _Found(parameters, bound.sites, cost)
        return cost, (slope - bound.hyperparameter_gradient()) * _UNIT

    def _starts(self, problem: SparseProblem) -> list[Sites]:
        if self.best is not None:
            return [self.best.sites]
        noise = self.rough.predict(self.inputs)
        signal = SparseSignal.of(problem, noise.log_noise_mean, noise.log_noise_variance)
        return [sites_from(signal.optimal_precisions, noise.log_noise_mean), fresh_sites(problem)]


def noise_penalty(vector: Array, n: int) -> tuple[float, Array]:
    """Minus the log prior of the hyperparameters (2 D + 3,) of n rows up to a constant, and its gradient."""
    d = (len(vector) - 3) // 2
    centre, spread = np.full(d + 1, _LENGTHSCALE), np.full(d + 1, _LENGTHSCALE_SPREAD)
    centre[-1], spread[-1] = _SD, _SD_SPREAD
    deviation = (vector[d + 1 : 2 * d + 2] - centre) / spread
    slope = np.zeros_like(vector)
    slope[d + 1 : 2 * d + 2] = _PRIOR_WEIGHT * n * deviation / spread
    return 0.5 * _PRIOR_WEIGHT * n * float(deviation @ deviation), slope
