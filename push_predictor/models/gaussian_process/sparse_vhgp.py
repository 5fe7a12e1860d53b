# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A VHGP of many rows, represented by the posterior of f and g at inducing inputs, and its fit.

The cost of a prediction depends on the number of inducing inputs, not of rows. The fit is coarse to fine: a dense VHGP
of few rows, then the sparse bound of more rows, then of all. Each stage chooses the inducing inputs by the
hyperparameters of the stage before and keeps them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.descent import Descent
from push_predictor.models.gaussian_process.fit import (
    FEW_ROWS,
    LOG_NUGGET_SD,
    NOISE_LENGTHSCALE,
    NOISE_LENGTHSCALE_SPREAD,
    NOISE_LOG_SD,
    SPREAD,
    Prior,
    Search,
)
from push_predictor.models.gaussian_process.gp import check_rows
from push_predictor.models.gaussian_process.inducing import InducedKernel, inducing_rows
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.types import Array, IntArray

DEFAULT_INDUCING = 100

_DENSE_ROWS = 500
_MIDDLE_ROWS = 5000
_MOST_ITERATIONS = 20
_SEARCH_TOLERANCE, _FINAL_TOLERANCE, _STOP = 4e-6, 1e-7, 1e-5  # nats a row
_REACH = np.log(30.0)  # by this factor a hyperparameter may change in a stage
_UNIT = 0.1  # of the logarithms: about the length of the first step
_NOTHING = 1e-9  # of the prior variance, a thousandth of the jitter
_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class InducedPosterior:
    """A function's posterior from inducing inputs Z (m, D): mean k(x, Z) weights, explained variance |k(x, Z) root|^2.

    weights (m,); root (m, r).
    """

    kernel: ArdKernel
    inducing: Array
    weights: Array
    root: Array

    @classmethod
    def of(cls, induced: InducedKernel, weights: Array, values: Array) -> InducedPosterior:
        """The posterior for values (n,) divided by the noise variances 1 / weights (n,)."""
        ridge = induced.regularise(weights)
        share, vectors = np.linalg.eigh(ridge.explained)
        kept = share > _NOTHING
        columns = np.column_stack([ridge.mean(values), vectors[:, kept] * np.sqrt(share[kept])])
        columns = scipy.linalg.blas.dtrsm(1.0, induced.factor, columns, lower=1, trans_a=1)
        return cls(induced.kernel, induced.inducing, columns[:, 0].copy(), np.ascontiguousarray(columns[:, 1:]))

    def predict(self, inputs: Array) -> tuple[Array, Array]:
        """Mean and explained variance at inputs (q, D), (q,) each."""
        cross = self.kernel.cross(inputs, self.inducing)
        half = cross @ self.root
        return cross @ self.weights, np.asarray(np.einsum("ij,ij->i", half, half))

    def covariance(self, inputs: Array) -> Array:
        """Posterior covariance (q, q) between inputs (q, D)."""
        half = self.kernel.cross(inputs, self.inducing) @ self.root
        return np.asarray(self.kernel.matrix(inputs) - half @ half.T)


class SparseVHGP:
    """A sparse VHGP conditioned on inputs (n, D) and outputs (n,), both standardised by the caller.

    site_precisions (n,) is Lambda of bound.py; inducing_signal and inducing_noise: which of the rows are inducing
    inputs of f and of g.
    """

    gaussian = False  # predictive distribution

    def __init__(
        self,
        inputs: Array,
        outputs: Array,
        parameters: VhgpParameters,
        site_precisions: Array,
        inducing_signal: IntArray,
        inducing_noise: IntArray,
    ) -> None:
        self.inputs, self.outputs = check_rows(inputs, outputs), outputs
        self.parameters, self.site_precisions = parameters, site_precisions
        self.inducing_signal, self.inducing_noise = inducing_signal, inducing_noise
        bound, signal, noise = self._solved()
        self.bound = bound.value
        weights = bound.signal.likelihood.ridge.weights
        self.signal = InducedPosterior.of(signal, weights, weights * outputs)
        share = 1.0 / (
            1.0 + parameters.nugget * site_precisions
        )  # of the noise behind which g is seen without a nugget
        of_noise = share * (bound.sites.potentials - site_precisions * parameters.noise_mean)
        self.noise = InducedPosterior.of(noise, share * site_precisions, of_noise)

    def _solved(self) -> tuple[Bound, InducedKernel, InducedKernel]:
        """The bound and its kernels, with (n, m) matrices, computed again on every call."""
        parameters, inputs = self.parameters, self.inputs
        signal = InducedKernel.of(parameters.signal, inputs, inputs[self.inducing_signal])
        noise = InducedKernel.of(parameters.noise, inputs, inputs[self.inducing_noise])
        problem = VhgpProblem.about(self.outputs, parameters, signal, noise)
        return Bound.tied(problem, self.site_precisions), signal, noise

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and g at inputs (q, D)."""
        parameters = self.parameters
        of_signal, of_noise, nugget = parameters.signal.variance, parameters.noise.variance, parameters.nugget
        mean, explained = self.signal.predict(inputs)
        log_noise, noise_explained = self.noise.predict(inputs)
        # As in a VHGP, the jitter is independent of the data.
        variance = np.maximum(of_signal + parameters.jitter - explained, parameters.jitter)
        log_noise_variance = nugget + np.maximum(of_noise - noise_explained, _EPSILON * of_noise)
        return LatentPrediction(mean, variance, parameters.noise_mean + log_noise, log_noise_variance)

    def function_covariance(self, inputs: Array) -> Array:
        """Posterior covariance (q, q) of f between inputs (q, D), without the jitter."""
        return self.signal.covariance(inputs)

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n training rows, each from the rows of all other blocks (n,), without a new fit."""
        return self._solved()[0].held_out(block)


def fit_sparse_vhgp(inputs: Array, outputs: Array, most_inducing: int = DEFAULT_INDUCING) -> SparseVHGP:
    """Maximise the sparse bound over hyperparameters and q(g).

    inputs (n, D) and outputs (n,) standardised; most_inducing: of f, and of g. The same rows give the same model.
    Raises TrainingError when the rows do not match, are not finite, or the bound is not finite anywhere.
    """
    check_rows(inputs, outputs)
    order = np.random.default_rng(0).permutation(len(outputs))
    few = np.sort(order[:_DENSE_ROWS])
    coarse = fit_vhgp(inputs[few], outputs[few])
    more = np.sort(order[:_MIDDLE_ROWS])
    return _refined(_refined(coarse, inputs[more], outputs[more], most_inducing), inputs, outputs, most_inducing)


def _refined(rough: VHGP | SparseVHGP, inputs: Array, outputs: Array, most_inducing: int) -> SparseVHGP:
    """The model of these rows, starting from a model of some of them."""
    n, first, noise = len(outputs), rough.parameters.to_vector(), rough.predict(inputs)
    chosen = [inducing_rows(k, inputs, most_inducing) for k in (rough.parameters.signal, rough.parameters.noise)]

    def problem_of(parameters: VhgpParameters) -> VhgpProblem:
        signal = InducedKernel.of(parameters.signal, inputs, inputs[chosen[0]])
        noise = InducedKernel.of(parameters.noise, inputs, inputs[chosen[1]])
        return VhgpProblem.about(outputs, parameters, signal, noise)

    search = Search(problem_of, noise_prior(inputs.shape[1], n), _SEARCH_TOLERANCE * n)
    search.seen = noise.log_noise_mean, noise.log_noise_variance
    box = np.column_stack([first - _REACH, first + _REACH])
    box[-2, 1] = np.inf  # one open side, see gp.py
    Descent(box, _MOST_ITERATIONS, _STOP).run(search.cost, first, _UNIT)
    try:
        return SparseVHGP(inputs, outputs, *search.solved(_FINAL_TOLERANCE * n), *chosen)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        raise TrainingError(f"no sparse VHGP of {n} rows was found: {error}") from None


def noise_prior(d: int, n: int) -> Prior:
    """Of g's hyperparameters: that of a dense fit; but its lengthscales' and its sd's for n rows as for a hundred."""
    centre, spread = np.zeros(2 * d + 4), np.full(2 * d + 4, np.inf)
    centre[d + 1 : -2] = [NOISE_LENGTHSCALE] * d + [NOISE_LOG_SD]
    spread[d + 1 : -2] = np.sqrt(FEW_ROWS / n) * np.array([NOISE_LENGTHSCALE_SPREAD] * d + [SPREAD])
    centre[-1], spread[-1] = LOG_NUGGET_SD, SPREAD
    return Prior(centre, spread)
