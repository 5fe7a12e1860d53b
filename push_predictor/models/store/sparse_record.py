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

"""How a sparse VHGP is written into a model file: one site precision per row, and the rows that are inducing inputs.

The posterior follows from them, the training rows and the hyperparameters; that takes a second for 100 000 rows.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.models.gaussian_process.parameters import VhgpParameters
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.types import Array, IntArray

_CHOSEN = ("inducing_signal", "inducing_noise")


def put_inducing(regression: SparseVHGP, output: int, arrays: dict[str, np.ndarray]) -> None:
    """Put the rows of the inducing inputs of one output's regression among the arrays."""
    for name, rows in zip(_CHOSEN, (regression.inducing_signal, regression.inducing_noise), strict=True):
        arrays[f"{name}_{output}"] = rows.astype(np.int32)


def has_inducing(output: int, arrays: Mapping[str, np.ndarray]) -> bool:
    """Whether the regression of an output is a sparse one."""
    return f"{_CHOSEN[0]}_{output}" in arrays


def sparse_regression(
    inputs: Array,
    outputs: Array,
    parameters: VhgpParameters,
    site_precisions: Array,
    output: int,
    arrays: Mapping[str, np.ndarray],
) -> SparseVHGP:
    """The regression. Raises ValueError or KeyError if the inducing inputs are not rows."""
    signal, noise = (_rows(arrays[f"{name}_{output}"], len(outputs), name) for name in _CHOSEN)
    return SparseVHGP(inputs, outputs, parameters, site_precisions, signal, noise)


def _rows(found: np.ndarray, n: int, name: str) -> IntArray:
    rows = np.asarray(found, dtype=np.int64)
    if rows.ndim != 1 or not 0 < len(np.unique(rows)) == len(rows) <= n or rows.min() < 0 or rows.max() >= n:
        raise ValueError(f"{name} does not contain distinct row indices below {n}")
    return rows
