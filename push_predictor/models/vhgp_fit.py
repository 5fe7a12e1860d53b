"""Maximise the VHGP's bound over its hyperparameters, with q(g) solved for at every step.

Variable projection: L-BFGS sees the 2 D + 3 hyperparameters only. A joint search over them and Lambda ends in
much worse optima, towards the homoscedastic solution.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError
from scipy.optimize import minimize

from push_predictor.errors import TrainingError
from push_predictor.models.vhgp_bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.vhgp_inner import maximise_over_noise
from push_predictor.types import Array

# Logarithms, for inputs and outputs of unit spread; they keep line searches where the kernels are sane.
_LENGTHSCALES = (np.log(1e-2), np.log(1e3))
_SIGNAL_SD = (np.log(1e-3), np.log(1e2))
_NOISE_SD = (np.log(1e-3), np.log(1e1))
_NOISE_MEAN = (np.log(1e-12), np.log(1e2))
_REFUSED = 1e10
_SEARCH_TOLERANCE = 1e-2  # nats
_FINAL_TOLERANCE = 1e-9


def maximise_bound(inputs: Array, outputs: Array, start: VhgpParameters, most_iterations: int) -> Bound:
    """The bound at its maximum, q(g) converged so that b = Lambda - 1/2.

    Raises TrainingError when the bound is not finite anywhere the search looked.
    """
    dimensions = inputs.shape[1]
    box = [_LENGTHSCALES] * dimensions + [_SIGNAL_SD] + [_LENGTHSCALES] * dimensions + [_NOISE_SD, _NOISE_MEAN]
    search = _Search(inputs, outputs)
    minimize(
        search.negative_bound, np.clip(start.to_vector(), *np.transpose(box)), jac=True, method="L-BFGS-B",
        bounds=box, options={"maxiter": most_iterations, "ftol": 1e-5},
    )  # fmt: skip
    if search.best is None:
        raise TrainingError(f"the variational bound of {len(outputs)} rows is not finite anywhere")
    return maximise_over_noise(search.best.problem, search.best, _FINAL_TOLERANCE)


class _Search:
    """The function that L-BFGS sees; `best` is the highest bound so far and where q(g) starts from."""

    def __init__(self, inputs: Array, outputs: Array) -> None:
        self.inputs, self.outputs = inputs, outputs
        self.best: Bound | None = None

    def negative_bound(self, vector: Array) -> tuple[float, Array]:
        try:
            problem = VhgpProblem.of(self.inputs, self.outputs, VhgpParameters.from_vector(vector))
            bound = maximise_over_noise(problem, self.best, _SEARCH_TOLERANCE)
        except (LinAlgError, FloatingPointError):
            return _REFUSED, np.zeros_like(vector)
        if self.best is None or bound.value > self.best.value:
            self.best = bound
        return -bound.value, -bound.hyperparameter_gradient()
