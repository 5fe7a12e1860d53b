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

"""A VHGP of many rows, represented by the posterior of f and g at inducing inputs.

The cost of a prediction depends on the number of inducing inputs, not of rows. bound.py has its bound, fit.py the
search for hyperparameters and inducing inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from push_predictor.models.gaussian_process.gp import check_rows
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.sparse.bound import SparseBound, SparseProblem
from push_predictor.models.gaussian_process.sparse.cross_validation import sparse_held_out_errors
from push_predictor.models.gaussian_process.sparse.kernel import InducedRidge
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.types import Array, IntArray

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
    def of(cls, ridge: InducedRidge, values: Array) -> InducedPosterior:
        """The posterior for values (n,) divided by the noise variances of the ridge."""
        induced = ridge.induced
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
        bound = self.solved()
        self.bound = bound.value
        self.signal = InducedPosterior.of(bound.signal.ridge, bound.signal.ridge.weights * outputs)
        sites = bound.sites.potentials - site_precisions * parameters.noise_mean
        self.noise = InducedPosterior.of(bound.noise_ridge, sites)

    def solved(self) -> SparseBound:
        """The bound with its (n, m) matrices, computed again on every call."""
        of_signal, of_noise = self.inputs[self.inducing_signal], self.inputs[self.inducing_noise]
        problem = SparseProblem.of(self.inputs, self.outputs, self.parameters, of_signal, of_noise)
        return SparseBound.tied(problem, self.site_precisions)

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and g at inputs (q, D)."""
        parameters = self.parameters
        of_signal, of_noise = parameters.signal.variance, parameters.noise.variance
        mean, explained = self.signal.predict(inputs)
        log_noise, noise_explained = self.noise.predict(inputs)
        # As in a VHGP, the jitter is independent of the data.
        variance = np.maximum(of_signal + parameters.jitter - explained, parameters.jitter)
        log_noise_variance = np.maximum(of_noise - noise_explained, _EPSILON * of_noise)
        return LatentPrediction(mean, variance, parameters.noise_mean + log_noise, log_noise_variance)

    def function_covariance(self, inputs: Array) -> Array:
        """Posterior covariance (q, q) of f between inputs (q, D), without the jitter."""
        return self.signal.covariance(inputs)

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n training rows from the rows of all other blocks; hyperparameters are kept.

        block (n,): number of each row's block.
        """
        bound, parameters = self.solved(), self.parameters
        errors, variance = sparse_held_out_errors(bound.signal.ridge, bound.signal.alpha, block)
        of_noise, noise_variance = sparse_held_out_errors(bound.noise_ridge, bound.mean_weights, block)
        site_variance = 1.0 / bound.sites.precisions
        variance += bound.problem.signal.unexplained - bound.signal.level
        noise_variance += bound.problem.noise.unexplained - site_variance
        return LatentPrediction(
            self.outputs - errors,
            np.maximum(variance, parameters.jitter),
            bound.noise_mean + bound.mean_weights * site_variance - of_noise,
            np.maximum(noise_variance, _EPSILON * parameters.noise.variance),
        )
