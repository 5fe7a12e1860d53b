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
from push_predictor.models.mechanics.surface import PowerSurface
from push_predictor.recordings.rig import Rig

LARGEST_RATIO = 100.0  # of the support's or the pusher's size to the outline's
FINEST, ROUGHEST = 1e-7, 0.1  # accuracies


def mechanics_record(fitted: FittedMechanics) -> dict[str, Any]:
    """The record of mechanics; outline and pusher are those of the model's rig."""
    support = fitted.mechanics.support
    return {
        "values": fitted.values,
        "covariance": fitted.covariance.tolist(),
        "support": None if support is None else _support_record(support),
        "supports": {str(number): _support_record(found) for number, found in fitted.mechanics.supports.items()},
        "accuracy": fitted.mechanics.accuracy,
    }


def mechanics_of(record: dict[str, Any], rig: Rig) -> FittedMechanics:
    """The mechanics of a record. Raises KeyError, TypeError, ValueError or RigError for a damaged one."""
    values = {str(name): float(value) for name, value in record["values"].items()}
    for name, value in values.items():
        if not BY_NAME[name].low <= value <= BY_NAME[name].high:
            raise ValueError(f"{name} {value!r}, {BY_NAME[name].low} to {BY_NAME[name].high} is accepted")
    covariance = np.array(record["covariance"], dtype=np.float64).reshape(len(values), len(values))
    if not np.all(np.isfinite(covariance)):
        raise ValueError("the covariance of the mechanics is not finite")
    supports = {int(number): _known(points, rig) for number, points in record["supports"].items()}
    found, accuracy = record["support"], float(record["accuracy"])
    support = None if found is None else (_power(found, rig) if isinstance(found, dict) else _known(found, rig))
    if not FINEST <= accuracy <= ROUGHEST:
        raise ValueError(f"accuracy {accuracy!r}, {FINEST} to {ROUGHEST} is accepted")
    return FittedMechanics(
        PushMechanics(rig.outline, rig.pusher_radius, support, supports, accuracy), values, covariance
    )


def _support_record(support: PressureDistribution | PowerSurface) -> Any:
    if isinstance(support, PowerSurface):
        return {"centre": support.centre.tolist(), "length": support.length, "power": support.power}
    return np.column_stack([support.points, support.shares]).tolist()


def _known(points: list[list[float]], rig: Rig) -> PressureDistribution:
    """A known support. Raises ValueError for one far larger or smaller than the slider: integration would take long."""
    support = supported_at(np.array(points))
    _check_size(rig, float(np.abs(support.points).max()), support.length)
    return support


def _power(record: dict[str, Any], rig: Rig) -> PowerSurface:
    centre = np.array(record["centre"], dtype=np.float64)
    surface = PowerSurface(centre, float(record["length"]), float(record["power"]))
    if centre.shape != (2,) or not 1.0 < surface.power < LARGEST_RATIO:
        raise ValueError(f"centre {record['centre']!r}, power {surface.power}: two numbers, and above 1, are needed")
    _check_size(rig, float(np.abs(centre).max()), surface.length)
    return surface


def _check_size(rig: Rig, largest: float, length: float) -> None:
    reach = float(np.abs(rig.outline.vertices).max())
    if not (max(largest, rig.pusher_radius) < LARGEST_RATIO * reach and length > reach / LARGEST_RATIO):
        raise ValueError("support points are far too large or too close together for the outline")
