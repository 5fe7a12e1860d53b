"""Maximise the VHGP's bound over its hyperparameters, with q(g) solved for at every step.

Variable projection: L-BFGS sees the 2 D + 3 hyperparameters only. A joint search over them and Lambda ends in
much worse optima, towards the homoscedastic solution.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError
from scipy.optimize import minimize

from push_predictor.errors import TrainingError
from push_predictor.models.gp import GpParameters
from push_predictor.models.vhgp_bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.vhgp_inner import maximise_over_noise
from push_predictor.types import Array

# Logarithms, for inputs and outputs of unit spread; they keep line searches where the kernels are sane.
_LENGTHSCALES = (np.log(1e-2), np.log(1e3))
_SIGNAL_SD = (np.log(1e-3), np.log(1e2))
_NOISE_SD = (np.log(1e-3), np.log(3.0))
_NOISE_MEAN = (np.log(1e-8), np.inf)  # open, see gp.py
_REFUSED = 1e10
_SEARCH_TOLERANCE = 2e-2  # nats
_FINAL_TOLERANCE = 1e-9

# Weak Gaussian priors on the logarithms. Without them the bound of 100 rows often peaks at far too confident a
# noise model, or at a homoscedastic one. The signal stays near the homoscedastic fit, the noise varies by a
# factor of exp(0.67) over half an input's spread. Bounds of 1000 rows outweigh them.
_NOISE_LENGTHSCALE, _NOISE_LENGTHSCALE_SPREAD = -0.7, 0.5
_NOISE_LOG_SD = -0.4
_SPREAD = 0.3


def maximise_bound(inputs: Array, outputs: Array, near: GpParameters, most_iterations: int) -> Bound:
    """The bound where it plus the log prior is highest, q(g) converged so that b = Lambda - 1/2.

    near: the homoscedastic fit of the same rows, where the search starts. Raises TrainingError when the bound
    is not finite anywhere the search looked.
    """
    d = inputs.shape[1]
    box = [_LENGTHSCALES] * d + [_SIGNAL_SD] + [_LENGTHSCALES] * d + [_NOISE_SD, _NOISE_MEAN]
    centre = np.clip(_prior_centre(near).to_vector(), *np.transpose(box))
    spread = np.full(2 * d + 3, _SPREAD)
    spread[d + 1 : 2 * d + 1] = _NOISE_LENGTHSCALE_SPREAD
    search = _Search(inputs, outputs, centre, spread)
    options = {"maxiter": most_iterations, "ftol": 1e-4}
    minimize(search.cost, centre, jac=True, method="L-BFGS-B", bounds=box, options=options)
    if search.best is None:
        raise TrainingError(f"the variational bound of {len(outputs)} rows is not finite anywhere")
    return maximise_over_noise(search.best.problem, search.best, _FINAL_TOLERANCE, most_steps=200)


def _prior_centre(gp: GpParameters) -> VhgpParameters:
    noise_lengthscales = np.full(len(gp.log_lengthscales), _NOISE_LENGTHSCALE)
    # so that the mean of exp(g) is the homoscedastic noise variance
    noise_mean = 2.0 * gp.log_noise_sd - 0.5 * float(np.exp(2.0 * _NOISE_LOG_SD))
    return VhgpParameters(gp.log_lengthscales, gp.log_signal_sd, noise_lengthscales, _NOISE_LOG_SD, noise_mean)


class _Search:
    """The function that L-BFGS sees; `best` is the bound at its lowest cost, and where q(g) starts from."""

    def __init__(self, inputs: Array, outputs: Array, centre: Array, spread: Array) -> None:
        self.inputs, self.outputs, self.centre, self.spread = inputs, outputs, centre, spread
        self.best: Bound | None = None
        self.lowest = np.inf

    def cost(self, vector: Array) -> tuple[float, Array]:
        """Minus the bound and the log prior, and its gradient."""
        try:
            problem = VhgpProblem.of(self.inputs, self.outputs, VhgpParameters.from_vector(vector))
            bound = maximise_over_noise(problem, self.best, _SEARCH_TOLERANCE)
        except (LinAlgError, FloatingPointError):
            return _REFUSED, np.zeros_like(vector)
        deviation = (vector - self.centre) / self.spread
        cost = 0.5 * float(deviation @ deviation) - bound.value
        if cost < self.lowest:
            self.lowest, self.best = cost, bound
        return cost, deviation / self.spread - bound.hyperparameter_gradient()
