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

"""How predictors are written into a model file: a JSON record each, and arrays that it shares with the training rows.

`predictor_record` writes by the class of the predictor, `predictor_of` reads by the keys of the record and the model's
kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import singledispatch
from typing import Any

import numpy as np

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.process_noise import VARYING, ProcessNoise
from push_predictor.models.predictors import (
    ExtendedPredictor,
    GaussianProcessPredictor,
    MechanicsPredictor,
    Predictor,
    PriorPredictor,
    Scaling,
)
from push_predictor.models.store.correlation_record import correlation_of, correlation_record
from push_predictor.models.store.effects_record import cross_of, cross_record, effects_of, effects_record
from push_predictor.models.store.mechanics_record import mechanics_of, mechanics_record
from push_predictor.models.store.regression_record import put_regression, regression_of, regression_record
from push_predictor.models.store.table_record import finite
from push_predictor.models.store.tails_record import tails_of, tails_record
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

BASE_OUTCOMES = "base_outcomes"
DRAWS = "draws"
MOST_DRAWS = 10_000
LEARNT = ("vhgp", "gp")


@dataclass(frozen=True)
class Source:
    """What a predictor's record does not repeat: the model's kind and rig, training rows, and the file's arrays."""

    kind: str
    rig: Rig
    training: PushTable
    arrays: Mapping[str, np.ndarray]
    targets: Array | None = None  # what the regressions were trained on, if not the outcomes of the training rows


@singledispatch
def predictor_record(predictor: Predictor, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """The record of a predictor; larger parts are put among the arrays."""
    raise TypeError(f"{type(predictor).__name__}: no record is defined for this class")


@predictor_record.register
def _extended_record(predictor: ExtendedPredictor, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    if isinstance(predictor.base, GaussianProcessPredictor):
        arrays[BASE_OUTCOMES] = predictor.base.targets  # those of the training rows minus the effects
    return {
        "base": predictor_record(predictor.base, arrays),
        "effects": effects_record(predictor.effects, arrays),
        "scale": predictor.scale.tolist(),
        **({"cross": cross_record(predictor.cross, arrays)} if predictor.cross else {}),
    }


@predictor_record.register
def _mechanics_record(predictor: MechanicsPredictor, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    return {"mechanics": mechanics_record(predictor.fitted), "covariance": predictor.covariance.tolist()}


@predictor_record.register
def _prior_record(predictor: PriorPredictor, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    arrays[DRAWS] = predictor.draws
    return {"mechanics": mechanics_record(predictor.fitted), "noise": predictor.noise.factor.tolist()}


@predictor_record.register
def _learnt_record(predictor: GaussianProcessPredictor, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    for k, regression in enumerate(predictor.regressions):
        put_regression(regression, k, arrays)
    return {
        "scaling": {
            key: np.asarray(value).tolist() for key, value in vars(predictor.scaling).items() if value is not None
        },
        "regressions": [regression_record(regression) for regression in predictor.regressions],
        **({"correlation": correlation_record(predictor.correlation, arrays)} if predictor.correlation else {}),
        **({"mean": {"mechanics": mechanics_record(predictor.mean)}} if predictor.mean else {}),
        **({"tails": tails_record(predictor.tails, arrays)} if predictor.tails else {}),
    }


def predictor_of(record: dict[str, Any], source: Source) -> Predictor:
    """The predictor of a record. Raises KeyError, TypeError, or ValueError for what no predictor has."""
    return _extended(record, source) if "effects" in record else _base(record, source)


def _base(record: dict[str, Any], source: Source) -> MechanicsPredictor | PriorPredictor | GaussianProcessPredictor:
    if source.kind == "prior":
        return _prior(record, source)
    if source.kind != "analytical":
        return _learnt(record, source)
    return _mechanics(record, source)


def _extended(record: dict[str, Any], source: Source) -> ExtendedPredictor:
    effects, scale = effects_of(record["effects"], source.arrays), np.array(record["scale"], dtype=np.float64)
    if scale.shape != (3,) or not np.all(np.isfinite(scale)) or np.any(scale <= 0.0):
        raise ValueError(f"scale {record['scale']!r}, three finite numbers above 0 are needed")
    if source.kind in LEARNT:
        source = replace(source, targets=finite(source.arrays, BASE_OUTCOMES))
    base = _base(record["base"], source)
    cross = cross_of(record.get("cross", []), effects, source.arrays)
    predictor = ExtendedPredictor(base, effects, scale, cross)
    if missing := [name for name in predictor.needs if name not in source.training.covariates]:
        raise ValueError(f"an effect needs the covariate {missing[0]}, which the training rows lack")
    return predictor


def _mechanics(record: dict[str, Any], source: Source) -> MechanicsPredictor:
    predictor = MechanicsPredictor(mechanics_of(record["mechanics"], source.rig), _covariance(record))
    if missing := [name for name in predictor.needs if name not in source.training.covariates]:
        raise ValueError(f"the mechanics need the covariate {missing[0]}, which the training rows lack")
    return predictor


def _prior(record: dict[str, Any], source: Source) -> PriorPredictor:
    fitted = mechanics_of(record["mechanics"], source.rig)
    draws, factor = finite(source.arrays, DRAWS), np.array(record["noise"], dtype=np.float64)
    if draws.ndim != 2 or draws.shape[1] != len(fitted.values) or not 2 <= len(draws) <= MOST_DRAWS:
        raise ValueError(f"draws of shape {draws.shape}, 2 to {MOST_DRAWS} of {len(fitted.values)} are needed")
    for name, column in zip(fitted.values, draws.T, strict=True):
        if column.min() < BY_NAME[name].low or column.max() > BY_NAME[name].high:
            raise ValueError(f"draws of {name}: {BY_NAME[name].low} to {BY_NAME[name].high} is accepted")
    if factor.shape != (3,) or not np.all(np.isfinite(factor)) or np.any(factor <= 0.0):
        raise ValueError(f"noise {record['noise']!r}, three finite numbers above 0 are needed")
    if missing := [name for name in VARYING if name not in fitted.values]:
        raise ValueError(f"the process noise needs the parameter {missing[0]}")
    return PriorPredictor(fitted, draws, ProcessNoise(factor))


def _covariance(record: dict[str, Any]) -> Array:
    """Of the outcomes about the mechanics (3, 3). Raises LinAlgError or ValueError for a damaged one."""
    covariance = np.array(record["covariance"], dtype=np.float64)
    if covariance.shape != (3, 3):
        raise ValueError(f"covariance of shape {covariance.shape}, (3, 3) is needed")
    np.linalg.cholesky(covariance)
    return covariance


def _learnt(record: dict[str, Any], source: Source) -> GaussianProcessPredictor:
    mean, scaling = _mean(record["mean"], source) if "mean" in record else None, _scaling(record)
    rows = source.training
    features = scaling.features(source.rig.outline, rows.inputs)
    if source.targets is None:
        moved = mean.displacement(rows.inputs, rows.duration, rows.covariates) if mean else 0.0
        targets = (rows.outcomes - moved) / scaling.size(rows.inputs, rows.duration)[:, None]
    else:
        targets = source.targets
    targets = scaling.outcomes(targets)
    regressions = [
        regression_of(parameters, source.kind, features, targets[:, k], k, source.arrays)
        for k, parameters in enumerate(record["regressions"])
    ]
    if len(regressions) != targets.shape[1]:
        raise ValueError(f"{len(regressions)} regressions, three are needed")
    correlation = correlation_of(record["correlation"], features, source.arrays) if "correlation" in record else None
    tails = tails_of(record["tails"], source.arrays) if "tails" in record else None
    return GaussianProcessPredictor(source.rig, scaling, tuple(regressions), correlation, mean, tails)


def _scaling(record: dict[str, Any]) -> Scaling:
    found = dict(record["scaling"])
    columns = tuple(int(c) for c in found.pop("columns"))
    travel, speeds = found.pop("travel", record.get("mean", {}).get("travel")), found.pop("speeds", None)
    if travel is not None and not 0.0 < float(travel) < np.inf:
        raise ValueError(f"travel {travel!r}, a finite number above 0 is needed")
    if speeds is not None:
        slowest, fastest = speeds
        if not 0.0 < slowest <= fastest < np.inf:
            raise ValueError(f"speeds {speeds!r}, two finite numbers above 0 in order are needed")
        speeds = (float(slowest), float(fastest))
    arrays = {key: np.array(value, dtype=np.float64) for key, value in found.items()}
    return Scaling(columns, **arrays, travel=None if travel is None else float(travel), speeds=speeds)


def _mean(record: dict[str, Any], source: Source) -> FittedMechanics:
    mean = mechanics_of(record["mechanics"], source.rig)
    if missing := [name for name in mean.needs if name not in source.training.covariates]:
        raise ValueError(f"the mechanics need the covariate {missing[0]}, which the training rows lack")
    return mean
