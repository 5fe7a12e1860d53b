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

"""How fitted mechanics are written into a model file: values by name, their covariance, and known supports."""

from __future__ import annotations

from typing import Any

import numpy as np

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.pressure import PressureDistribution, supported_at
from push_predictor.recordings.rig import Rig

LARGEST_RATIO = 100.0  # of the support's size to the outline's


def mechanics_record(fitted: FittedMechanics) -> dict[str, Any]:
    """The record of fitted mechanics; outline and pusher are those of the model's rig."""
    support = fitted.mechanics.support
    if support is not None and not isinstance(support, PressureDistribution):
        raise TypeError(f"{type(support).__name__}: no record is defined for an approximate limit surface")
    return {
        "values": fitted.values,
        "covariance": fitted.covariance.tolist(),
        "support": None if support is None else _points(support),
        "supports": {str(number): _points(found) for number, found in fitted.mechanics.supports.items()},
    }


def mechanics_of(record: dict[str, Any], rig: Rig) -> FittedMechanics:
    """The fitted mechanics of a record. Raises KeyError, TypeError, ValueError or RigError for a damaged one."""
    values = {str(name): float(value) for name, value in record["values"].items()}
    for name, value in values.items():
        if not BY_NAME[name].low <= value <= BY_NAME[name].high:
            raise ValueError(f"{name} {value!r}, {BY_NAME[name].low} to {BY_NAME[name].high} is accepted")
    covariance = np.array(record["covariance"], dtype=np.float64).reshape(len(values), len(values))
    if not np.all(np.isfinite(covariance)):
        raise ValueError("the covariance of the mechanics is not finite")
    supports = {int(number): _support(points, rig) for number, points in record["supports"].items()}
    support = None if record["support"] is None else _support(record["support"], rig)
    return FittedMechanics(PushMechanics(rig.outline, rig.pusher_radius, support, supports), values, covariance)


def _support(points: list[list[float]], rig: Rig) -> PressureDistribution:
    """A known support. Raises ValueError for one far larger or smaller than the slider: integration would never end."""
    support, reach = supported_at(np.array(points)), float(np.abs(rig.outline.vertices).max())
    if not (float(np.abs(support.points).max()) < LARGEST_RATIO * reach and support.length > reach / LARGEST_RATIO):
        raise ValueError("support points are far too large or too close together for the outline")
    return support


def _points(support: PressureDistribution) -> list[list[float]]:
    points: list[list[float]] = np.column_stack([support.points, support.shares]).tolist()
    return points
