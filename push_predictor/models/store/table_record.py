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

"""How the training rows are written into a model file: an array each for inputs, durations, outcomes and covariates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

LONGEST_PUSH = 10.0  # m


def table_arrays(table: PushTable) -> dict[str, np.ndarray]:
    """The arrays of a table; `table_of` needs the names of its covariates too."""
    pushes = table.pushes
    index = {push: k for k, push in enumerate(pushes)}
    arrays: dict[str, np.ndarray] = {
        "inputs": table.inputs,
        "duration": table.duration,
        "outcomes": table.outcomes,
        "pushes": np.array(pushes, dtype=np.str_),
        "push_of_row": np.array([index[push] for push in table.push_id.tolist()], dtype=np.int32),
    }
    for k, column in enumerate(table.covariates.values()):
        arrays[f"covariate_{k}"] = column.astype(np.float32)  # seven digits are enough for conditions of a push
    return arrays


def table_of(covariates: Sequence[str], arrays: Mapping[str, np.ndarray]) -> PushTable:
    """The table of these arrays. Raises KeyError, or ValueError for values that no table has."""
    columns = {name: arrays[f"covariate_{k}"].astype(float) for k, name in enumerate(covariates)}
    push_id = arrays["pushes"][arrays["push_of_row"]]
    inputs, duration = finite(arrays, "inputs"), finite(arrays, "duration")
    table = PushTable(inputs, duration, finite(arrays, "outcomes"), push_id, columns)
    if not np.all(np.abs(inputs[:, 0] * duration) < LONGEST_PUSH):
        raise ValueError(f"a training push is longer than {LONGEST_PUSH:g} m")
    return table


def finite(arrays: Mapping[str, np.ndarray], name: str) -> Array:
    """An array of finite numbers. Raises ValueError for others."""
    column = np.asarray(arrays[name], dtype=np.float64)
    if not np.all(np.isfinite(column)):
        raise ValueError(f"{name} contains a value that is not finite")
    return column
