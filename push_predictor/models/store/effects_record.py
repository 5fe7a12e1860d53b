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

"""How effects are written into a model file: JSON records, with their covariances as arrays; every value is checked."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from push_predictor.models.effects.driver_basis import BASES, DriverBasis, columns_of
from push_predictor.models.effects.effect import Effect, generic_width
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS, mechanism_named
from push_predictor.models.predictors import Cross
from push_predictor.types import Array

DRIVERS = {"constant": 0, "map": 2}  # how many a basis takes; all others one
SCALED = ("linear", "quadratic", "map", "logarithmic")


def effects_record(effects: tuple[Effect, ...], arrays: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """The records of effects; their covariances go into `arrays`."""
    for k, effect in enumerate(effects):
        arrays[f"effect_covariance_{k}"] = effect.covariance
    return [_record(effect) for effect in effects]


def effects_of(records: list[Any], arrays: Mapping[str, np.ndarray]) -> tuple[Effect, ...]:
    """The effects of records. Raises ValueError that names the effect and what is wrong with it."""
    effects = []
    for k, record in enumerate(records):
        try:
            effects.append(_effect(record, np.asarray(arrays[f"effect_covariance_{k}"], dtype=np.float64)))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ValueError(f"effect {k}: {error}") from None
    return tuple(effects)


def cross_record(cross: Cross, arrays: dict[str, np.ndarray]) -> list[list[int]]:
    """Pairs of effects with a cross-covariance; the covariances go into `arrays`."""
    for (i, j), shared in cross.items():
        arrays[f"effect_covariance_{i}_{j}"] = shared
    return [list(pair) for pair in cross]


def cross_of(pairs: list[Any], effects: tuple[Effect, ...], arrays: Mapping[str, np.ndarray]) -> Cross:
    """The cross-covariances of effects. Raises ValueError if, with the effects' own, they do not form a covariance."""
    ends = np.cumsum([0, *(len(effect.coefficients) for effect in effects)]).tolist()
    parts = [slice(low, high) for low, high in pairwise(ends)]
    whole, cross = np.zeros((ends[-1], ends[-1])), {}
    for part, effect in zip(parts, effects, strict=True):
        whole[part, part] = effect.covariance
    for i, j in pairs:
        if not 0 <= i < j < len(effects):
            raise ValueError(f"shared covariance of effects {i!r} and {j!r}, give indices i < j below {len(effects)}")
        shared = np.asarray(arrays[f"effect_covariance_{i}_{j}"], dtype=np.float64)
        if shared.shape != (size := (len(effects[i].coefficients), len(effects[j].coefficients))):
            raise ValueError(f"effects {i} and {j}: covariance of shape {shared.shape}, {size} is needed")
        cross[i, j] = shared
        whole[parts[i], parts[j]], whole[parts[j], parts[i]] = shared, shared.T
    _check_covariance(whole, "covariance of all effects")
    return cross


def _check_covariance(covariance: Array, name: str) -> None:
    if not np.all(np.isfinite(covariance)):
        raise ValueError(f"{name}: a value is not finite")
    sd = np.sqrt(np.maximum(np.diag(covariance), np.finfo(np.float64).tiny))
    if np.linalg.eigvalsh(covariance / np.outer(sd, sd))[0] < -1e-6:  # coefficients have units of their own
        raise ValueError(f"{name} is not positive semidefinite")


def _record(effect: Effect) -> dict[str, Any]:
    return {
        "mechanism": effect.mechanism,
        "covariate": effect.covariate,
        "form": {key: list(value) if isinstance(value, tuple) else value for key, value in vars(effect.basis).items()},
        "coefficients": effect.coefficients.tolist(),
        "outcome_scale": effect.outcome_scale.tolist(),
    }


def _effect(record: dict[str, Any], covariance: Array) -> Effect:
    mechanism, basis = record["mechanism"], _basis(record["form"])
    if mechanism is not None and mechanism not in [known.name for known in (*LIBRARY, *REFINEMENTS)]:
        raise ValueError(f"mechanism {mechanism!r} is not in the library")
    width = generic_width() if mechanism is None else len(mechanism_named(mechanism).parameters)
    size = width * columns_of(basis)
    coefficients = _numbers(record, "coefficients", size)
    if covariance.shape != (size, size) or not np.all(np.isfinite(covariance)):
        raise ValueError(f"covariance of shape {covariance.shape}, {size} x {size} finite numbers are needed")
    if np.linalg.eigvalsh(covariance)[0] < -1e-9 * np.trace(covariance):
        raise ValueError("covariance is not positive semidefinite")
    scale = _numbers(record, "outcome_scale", 3)
    return Effect(mechanism, str(record["covariate"]), basis, coefficients, covariance, scale)


def _basis(record: dict[str, Any]) -> DriverBasis:
    name, drivers = record["name"], tuple(record["drivers"])
    if name not in BASES:
        raise ValueError(f"form {name!r} is not accepted, give one of {', '.join(BASES)}")
    if len(drivers) != DRIVERS.get(name, 1) or not all(isinstance(driver, str) for driver in drivers):
        raise ValueError(f"form {name!r} does not accept the drivers {drivers!r}, give {DRIVERS.get(name, 1)} name(s)")
    scaled = len(drivers) if name in SCALED else None
    centre, scale = _numbers(record, "centre", scaled), _numbers(record, "scale", scaled)
    if np.any(scale == 0.0):
        raise ValueError(f"form {name!r} has a scale of zero")
    place, levels = float(_numbers(record, "place", 1)[0]), _numbers(record, "levels", None)
    return DriverBasis(name, drivers, tuple(centre.tolist()), tuple(scale.tolist()), place, tuple(levels.tolist()))


def _numbers(record: dict[str, Any], name: str, count: int | None) -> Array:
    values = np.atleast_1d(np.array(record[name], dtype=np.float64))
    if values.ndim != 1 or count not in (None, len(values)) or not np.all(np.isfinite(values)):
        raise ValueError(f"{name} {record[name]!r}, {'' if count is None else f'{count} '}finite numbers are needed")
    return values
