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

"""How tails are written into a model file: their numbers in the header, their quantiles as an array."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.models.predictors.tails import STEPS, Tails
from push_predictor.types import Array

_QUANTILES = "tails_quantiles"


def tails_record(tails: Tails, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """The record; the quantiles are put among the arrays."""
    arrays[_QUANTILES] = tails.quantiles
    return {
        "scale": tails.scale.tolist(),
        "degrees": tails.degrees.tolist(),
        "joint_scale": tails.joint_scale,
        "joint_degrees": tails.joint_degrees,
        "pushes": tails.pushes,
    }


def tails_of(record: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Tails:
    """The tails of a record. Raises ValueError, KeyError for damaged ones."""
    scale, degrees = _numbers(record, "scale", 0.0), _numbers(record, "degrees", 2.0)
    joint_scale, joint_degrees = _number(record, "joint_scale", 0.0), _number(record, "joint_degrees", 2.0)
    pushes = record["pushes"]
    if isinstance(pushes, bool) or not isinstance(pushes, int) or pushes < 1:
        raise ValueError(f"pushes {pushes!r} of the tails, a whole number of at least 1 is needed")
    return Tails(scale, degrees, joint_scale, joint_degrees, pushes, _quantiles(arrays[_QUANTILES]))


def _numbers(record: Mapping[str, Any], name: str, above: float) -> Array:
    values = np.array(record[name], dtype=np.float64)
    if values.shape != (3,) or not np.all(np.isfinite(values)) or np.any(values <= above):
        raise ValueError(f"{name} {record[name]!r} of the tails, three finite numbers above {above:g} are needed")
    return values


def _number(record: Mapping[str, Any], name: str, above: float) -> float:
    value = float(record[name])
    if not (np.isfinite(value) and value > above):
        raise ValueError(f"{name} {record[name]!r} of the tails, a finite number above {above:g} is needed")
    return value


def _quantiles(found: np.ndarray) -> Array:
    values = np.asarray(found, dtype=np.float64)
    if values.shape != (STEPS, 3) or not np.all(np.isfinite(values)):
        raise ValueError(f"quantiles of the tails are not {STEPS} times three finite numbers")
    if np.any(values < 0.0) or np.any(np.diff(values, axis=0) < 0.0):
        raise ValueError("quantiles of the tails: numbers of at least 0 that do not decrease are needed")
    return values
