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

"""A regression of one output, any of this folder, and the choice between several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from push_predictor.models.gaussian_process.constant import ConstantNoise
from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.quadrature import exact_log_density
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.types import Array, IntArray

KernelRegression: TypeAlias = GaussianProcess | VHGP | SparseVHGP
Regression: TypeAlias = KernelRegression | ConstantNoise


def held_out_score(regression: Regression, block: IntArray, observed: Array | None = None) -> float:
    """Log density of the training rows when their blocks (n,) are held out, less the number of hyperparameters, nats.

    observed (n,): the outputs as they are if also their mean function is fitted without the block; by default the
    regression's. The hyperparameters are those of all rows, which makes the held-out density too good by about their
    number (Akaike 1974, for fits by maximum likelihood).
    """
    observed = regression.outputs if observed is None else observed
    return float(exact_log_density(regression.held_out(block), observed).sum()) - regression.parameters.count


def best_held_out(regressions: Sequence[Regression], block: IntArray, observed: Array | None = None) -> Regression:
    """The regression with the highest held-out score; of equal ones the first."""
    return max(regressions, key=lambda regression: held_out_score(regression, block, observed))
