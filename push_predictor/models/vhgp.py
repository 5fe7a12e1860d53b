"""Variational heteroscedastic Gaussian process regression (Lazaro-Gredilla and Titsias, ICML 2011).

    y = f(x) + e,  f ~ GP(0, k_f),  e ~ N(0, exp(g(x))),  g ~ GP(mu0, k_g)

The model of Bauza and Rodriguez (ICRA 2017) for planar pushing, derived from first principles; docs/errata.md
lists where the printed equations differ. Inputs and outputs are standardised by the caller.
"""

from __future__ import annotations

import numpy as np

from push_predictor.models.gp import GaussianProcess, check_rows, fit_gp
from push_predictor.models.posterior import KernelPosterior
from push_predictor.models.prediction import LatentPrediction
from push_predictor.models.vhgp_bound import JITTER, Bound, VhgpParameters, VhgpProblem
from push_predictor.models.vhgp_fit import maximise_bound
from push_predictor.types import Array


class VHGP:
    """A VHGP conditioned on inputs (n, D) and outputs (n,); site_precisions (n,) is Lambda of vhgp_bound."""

    def __init__(self, inputs: Array, outputs: Array, parameters: VhgpParameters, site_precisions: Array) -> None:
        self.inputs, self.outputs = check_rows(inputs, outputs), outputs
        self.parameters, self.site_precisions = parameters, site_precisions
        problem = VhgpProblem.of(inputs, outputs, parameters)
        bound = Bound.tied(problem, site_precisions)
        self.bound = bound.value
        self._signal = KernelPosterior(problem.signal_kernel.matrix, bound.noise_level + parameters.jitter)
        self._noise = KernelPosterior(problem.noise_kernel.matrix, 1.0 / site_precisions)
        self._signal_weights = self._signal.weights(outputs)
        self._noise_weights = bound.mean_weights

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and g at inputs (m, D)."""
        signal, noise = self.parameters.signal, self.parameters.noise
        of_signal, of_noise = signal.cross(inputs, self.inputs), noise.cross(inputs, self.inputs)
        # The jitter is independent of the data, so it is what the variance of f cannot fall below.
        variance = signal.variance * (1.0 + JITTER) - self._signal.explained_variance(of_signal)
        log_noise_variance = noise.variance - self._noise.explained_variance(of_noise)
        return LatentPrediction(
            of_signal @ self._signal_weights,
            np.maximum(variance, JITTER * signal.variance),
            self.parameters.noise_mean + of_noise @ self._noise_weights,
            np.maximum(log_noise_variance, np.finfo(float).eps * noise.variance),
        )


def fit_vhgp(inputs: Array, outputs: Array, start: GaussianProcess | None = None, *, most_iterations: int = 40) -> VHGP:
    """Maximise the variational bound (plus weak priors, see vhgp_fit) over hyperparameters and site precisions.

    inputs (n, D) and outputs (n,) standardised. start: a homoscedastic process of the same rows, else one is
    fitted first. Raises TrainingError when the rows do not match or are not finite.
    """
    check_rows(inputs, outputs)
    gp = start or fit_gp(inputs, outputs)
    bound = maximise_bound(inputs, outputs, gp.parameters, most_iterations)
    return VHGP(inputs, outputs, bound.problem.parameters, bound.site_precisions)
