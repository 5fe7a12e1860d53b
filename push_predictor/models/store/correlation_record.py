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

"""How a correlation is written into a model file: its two numbers in the header, its residuals as an array."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.models.predictors.correlation import Correlation
from push_predictor.types import Array, IntArray

_RESIDUALS, _ROWS = "correlation_residuals", "correlation_rows"


def correlation_record(correlation: Correlation, arrays: dict[str, np.ndarray]) -> dict[str, float]:
    """The record; the residuals and their row numbers are put among the arrays; features follow from the rows."""
    arrays[_RESIDUALS] = correlation.residuals.astype(np.float32)
    if correlation.rows is not None:
        arrays[_ROWS] = correlation.rows.astype(np.int32)
    return {"bandwidth": correlation.bandwidth, "shrinkage": correlation.shrinkage}


def correlation_of(record: Mapping[str, Any], features: Array, arrays: Mapping[str, np.ndarray]) -> Correlation:
    """The correlation of a record over training rows with these features (n, D). Raises ValueError, KeyError."""
    numbers = {name: float(record[name]) for name in ("bandwidth", "shrinkage")}
    for name, value in numbers.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} {value!r} of the correlation, a finite number above 0 is needed")
    rows = _rows(arrays[_ROWS], len(features)) if _ROWS in arrays else None
    features = features if rows is None else features[rows]
    residuals = np.asarray(arrays[_RESIDUALS], dtype=np.float64)
    if residuals.shape != (len(features), 3) or not np.all(np.isfinite(residuals)):
        raise ValueError(f"residuals of the correlation are not {len(features)} times three finite numbers")
    return Correlation(features, residuals, rows=rows, **numbers)


def _rows(found: np.ndarray, count: int) -> IntArray:
    rows = np.asarray(found, dtype=np.int64)
    if rows.ndim != 1 or np.any(rows < 0) or np.any(rows >= count):
        raise ValueError(f"rows of the correlation are not indices below {count}")
    return rows
