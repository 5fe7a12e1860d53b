# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Maximise the VHGP's bound over its hyperparameters, with q(g) solved for at every step.

Variable projection: L-BFGS sees the 2 D + 4 hyperparameters only. A joint search over them and Lambda ends in much
worse optima, towards the homoscedastic solution. No n x n matrix is kept from one evaluation to the next.

At fixed hyperparameters, q(g) takes natural-gradient (here: Newton) steps, untied. Each sets the natural parameters of
q(g) to the point that the gradient makes stationary. With mean and precision updated separately, the first steps
converge by a factor of 10 to 40 each. The seemingly equivalent iteration on Lambda alone, with the mean tied to it,
diverges.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.bound import Bound, SignalFit, Sites, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.gp import NEAR, Descent, GpParameters
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
    inputs: Array,
    outputs: Array,
    near: GpParameters,
    most_iterations: int,
    shortest: float,
    first: VhgpParameters | None = None,
) -> tuple[VhgpParameters, Array]:
    """Hyperparameters where the bound plus the log prior is highest, and the site precisions (n,), tied to them.

    near: a homoscedastic fit of these rows or some of them, about which the prior is. first: where the search starts,
    the maximum of some of the rows; None: at the prior's centre. shortest: lengthscale of the signal. Raises
    TrainingError if the bound is not finite at any point of the search.
    """
    d, n = inputs.shape[1], len(outputs)
    box = _box(d, shortest)
    centre = np.clip(_prior_centre(near).to_vector(), *box.T)
    search = Search(partial(VhgpProblem.of, inputs, outputs), Prior(centre, _spread(d, n)), _SEARCH_TOLERANCE)
    begin, unit = (centre, 1.0) if first is None else (np.clip(first.to_vector(), *box.T), NEAR)
    Descent(box, most_iterations, _STOP).run(search.cost, begin, unit)
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


_SHORTEST_STEP = 1.0 / 64.0
_PART = 0.02
_MOST_STEPS = 60
_USUAL_SHARE, _LARGEST_SHARE = 0.25, 0.8  # gain of a step over that of the step before


def maximise_over_noise(
    problem: VhgpProblem, start: Sites | None, tolerance: float, *, goal: float | None = None
) -> Bound:
    """The bound at its maximum over (mean weights, site precisions), found to `tolerance` nats.

    start: the sites of neighbouring hyperparameters on the same rows, where the search begins. goal: the value that
    the result will be compared with; far from it the tolerance is a fraction of the difference.
    Raises LinAlgError or FloatingPointError where the bound is not finite even at a fresh start.
    """
    bound = _first(problem, start)
    progress = _Progress()
    for _ in range(_MOST_STEPS):
        value, sites, target = bound.value, bound.sites, bound.optimal_sites
        del bound  # frees its matrices before the next ones are computed
        bound, accepted = _improved(problem, value, sites, target, tolerance)
        enough = tolerance if goal is None else max(tolerance, _PART * abs(bound.value - goal))
        if not accepted or progress.remaining(bound.value - value) < enough:
            return bound
    return bound


class _Progress:
    """The gain that further steps can bring, if each brings the same share of the one before, as the last two did."""

    def __init__(self) -> None:
        self._last: float | None = None

    def remaining(self, gain: float) -> float:
        """Expected gain of all further steps, nats, after a step that gained this much."""
        last, self._last = self._last, gain
        share = _USUAL_SHARE if last is None or last <= 0.0 else min(gain / last, _LARGEST_SHARE)
        return gain * max(share, _USUAL_SHARE) / (1.0 - max(share, _USUAL_SHARE))


def _first(problem: VhgpProblem, start: Sites | None) -> Bound:
    if start is not None:
        try:
            return Bound.at(problem, start)
        except (np.linalg.LinAlgError, FloatingPointError):
            pass  # a far line search: the old sites do not suit the new hyperparameters
    return Bound.tied(problem, np.full(len(problem.outputs), 0.5))


def _improved(problem: VhgpProblem, value: float, sites: Sites, target: Sites, tolerance: float) -> tuple[Bound, bool]:
    """The bound after the longest step of 1, 1/2, 1/4 ... to the target that does not lower it.

    Also whether there is such a step; if not, the bound is returned unchanged.
    """
    step = 1.0
    while step >= _SHORTEST_STEP:
        candidate = _bound_if_above(value - 1e-3 * tolerance, problem, sites.towards(target, step))
        if candidate is not None:
            return candidate, True
        step *= 0.5
    return Bound.at(problem, sites), False


def _bound_if_above(lowest: float, problem: VhgpProblem, sites: Sites) -> Bound | None:
    try:
        bound = Bound.at(problem, sites)
    except (np.linalg.LinAlgError, FloatingPointError):
        return None
    return bound if bound.value >= lowest else None
