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

"""How posteriors for single pushes are written into a file of tables: their arrays, and the rest as a JSON record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.models.gaussian_process.constant import ConstantNoise
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.store.table_record import finite
from push_predictor.models.tabulated.single_push.posteriors import SinglePosterior, SinglePosteriors, SingleRegression
from push_predictor.types import Array

ARRAYS = ("inverse", "inputs", "weights", "pivots", "factor")


def single_record(single: SinglePosteriors, arrays: dict[str, Array]) -> list[Any]:
    """One entry an output, null if it is constant; adds the arrays."""
    return [_record(regression, f"single_{k}", arrays) for k, regression in enumerate(single.regressions)]


def single_from(
    predictor: GaussianProcessPredictor, record: list[Any], arrays: Mapping[str, np.ndarray]
) -> SinglePosteriors:
    """The posteriors of a record. Raises KeyError, TypeError or ValueError for values that none has."""
    regressions: list[SingleRegression | ConstantNoise] = []
    for k, (entry, regression) in enumerate(zip(record, predictor.regressions, strict=True)):
        if isinstance(regression, ConstantNoise):
            regressions.append(regression)
            continue
        signal = _posterior(entry["signal"], f"single_{k}_signal", arrays)
        noise = None if entry["noise"] is None else _posterior(entry["noise"], f"single_{k}_noise", arrays)
        regressions.append(SingleRegression(float(entry["log_noise"]), signal, noise))
    return SinglePosteriors(predictor, regressions)


def _record(regression: SingleRegression | ConstantNoise, name: str, arrays: dict[str, Array]) -> Any:
    if isinstance(regression, ConstantNoise):
        return None
    parts = {"signal": regression.signal, "noise": regression.noise}
    for part, posterior in parts.items():
        if posterior is not None:
            arrays |= {f"{name}_{part}_{field}": getattr(posterior, field) for field in ARRAYS}
    numbers = {part: None if of is None else [of.prior, of.least] for part, of in parts.items()}
    return {"log_noise": regression.log_noise, **numbers}


def _posterior(numbers: list[float], name: str, arrays: Mapping[str, np.ndarray]) -> SinglePosterior:
    prior, least = map(float, numbers)
    inverse, inputs, weights, factor = (finite(arrays, f"{name}_{field}") for field in ARRAYS if field != "pivots")
    factor = factor.astype(arrays[f"{name}_factor"].dtype)
    return SinglePosterior(inverse, inputs, weights, arrays[f"{name}_pivots"], factor, prior, least)
