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

"""Greedy selection of inducing inputs: repeatedly add the row with the largest conditional variance given those chosen.

This is a pivoted Cholesky factorisation of the kernel matrix ("greedy conditional variance" of Burt, Rasmussen and van
der Wilk 2020, "Convergence of sparse variational inference in Gaussian processes regression"). It depends on the
kernel's hyperparameters; the only random choice is that of the candidates.
"""

from __future__ import annotations

import numpy as np

from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.types import Array, IntArray

_CANDIDATES = 10_000
_TOLD = 1e-6  # of the prior variance; with a smaller conditional variance one more inducing input adds nothing


def inducing_rows(kernel: ArdKernel, inputs: Array, most: int, weights: Array | None = None) -> IntArray:
    """At most `most` rows of inputs (n, D), in their order; fewer if these determine all others.

    weights (n,): of each row's conditional variance, 1 if not given.
    """
    candidates = np.sort(np.random.default_rng(0).permutation(len(inputs))[:_CANDIDATES])
    found = inputs[candidates]
    counts = np.ones(len(found)) if weights is None else weights[candidates]
    most = min(most, len(found))
    unknown, root, chosen = np.full(len(found), kernel.variance), np.empty((most, len(found))), []
    for k in range(most):
        row = int(np.argmax(unknown * counts))
        if unknown[row] < _TOLD * kernel.variance:
            break
        known = kernel.cross(found[row : row + 1], found)[0] - root[:k, row] @ root[:k]
        root[k] = known / np.sqrt(unknown[row])
        unknown = np.maximum(unknown - root[k] ** 2, 0.0)
        unknown[row] = 0.0
        chosen.append(row)
    return np.sort(candidates[chosen])
