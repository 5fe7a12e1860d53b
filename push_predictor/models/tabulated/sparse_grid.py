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

"""A sparse VHGP as its posteriors on grids, from which prediction_table.py makes a table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.gaussian_process.sparse.vhgp import InducedPosterior, SparseVHGP
from push_predictor.models.tabulated.grid_posterior import GridPosterior, GridRegression
from push_predictor.types import Array, IntArray

_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class InducedGridPosterior(GridPosterior):
    """A GridPosterior of inducing inputs; root (m, r) as in InducedPosterior, so that no factorisation is needed."""

    root: Array

    @cached_property
    def _explaining(self) -> tuple[IntArray, Array]:
        return np.arange(len(self.inputs)), self.kernel.variance * self.root


def sparse_grid_regression(regression: SparseVHGP) -> GridRegression:
    """See grid_posterior.grid_regression."""
    parameters = regression.parameters
    jitter, of_noise, nugget = parameters.jitter, parameters.noise.variance, parameters.nugget
    signal = _on_grid(regression.signal, parameters.signal.variance + jitter, jitter)
    noise = _on_grid(regression.noise, of_noise + nugget, nugget + _EPSILON * of_noise)
    return GridRegression(signal, parameters.noise_mean, noise)


def _on_grid(posterior: InducedPosterior, prior_variance: float, least_variance: float) -> InducedGridPosterior:
    inputs, weights, none = posterior.inducing, posterior.weights, np.empty(0)
    return InducedGridPosterior(posterior.kernel, inputs, none, weights, prior_variance, least_variance, posterior.root)
