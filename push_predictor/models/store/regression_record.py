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

"""How a regression is written into a model file: hyperparameters in the record, site precisions as an array.

Its matrices are not stored. They follow from the training rows, the hyperparameters and the site precisions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.models.gaussian_process.gp import GaussianProcess, GpParameters
from push_predictor.models.gaussian_process.parameters import VhgpParameters
from push_predictor.models.gaussian_process.regression import ConstantNoise, ConstantParameters, Regression
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.store.sparse_record import has_inducing, put_inducing, sparse_regression
from push_predictor.types import Array

CONSTANT = "noise_spread"  # only constant noise has this hyperparameter
LARGEST_SPREAD = 10.0
NUGGET, NO_NUGGET = "log_nugget_sd", -12.0  # of files that lack it: so small that it changes no prediction


def regression_record(regression: Regression) -> dict[str, Any]:
    """The hyperparameters; without the nugget if the file that they are from lacked it."""
    values = {key: np.asarray(value).tolist() for key, value in vars(regression.parameters).items()}
    return {key: value for key, value in values.items() if (key, value) != (NUGGET, NO_NUGGET)}


def put_regression(regression: Regression, output: int, arrays: dict[str, np.ndarray]) -> None:
    """Put what an output's regression has of arrays among those of the file."""
    if isinstance(regression, VHGP | SparseVHGP):
        arrays[f"site_precisions_{output}"] = regression.site_precisions
    if isinstance(regression, SparseVHGP):
        put_inducing(regression, output, arrays)


def regression_of(
    record: dict[str, Any], kind: str, features: Array, outcomes: Array, output: int, arrays: Mapping[str, np.ndarray]
) -> Regression:
    """The regression of one output on standardised features (n, D) and outcomes (n,). Raises ValueError."""
    if CONSTANT in record:
        return ConstantNoise(features, outcomes, _constant(record))
    values, sites = _hyperparameters(record), arrays.get(f"site_precisions_{output}")
    if kind == "gp":
        return GaussianProcess(features, outcomes, GpParameters(**values))
    if sites is None or sites.shape != outcomes.shape or not np.all(np.isfinite(sites)) or np.any(sites < 0.0):
        raise ValueError(f"site precisions are missing or not {len(outcomes)} finite numbers from 0 on")
    if has_inducing(output, arrays):
        return sparse_regression(
            features, outcomes, VhgpParameters(**{NUGGET: NO_NUGGET, **values}), sites, output, arrays
        )
    return VHGP(features, outcomes, VhgpParameters(**{NUGGET: NO_NUGGET, **values}), sites)


def _constant(record: dict[str, Any]) -> ConstantParameters:
    parameters = ConstantParameters(**{key: float(value) for key, value in record.items()})
    if not (np.isfinite(parameters.noise_mean) and 0.0 <= parameters.noise_spread < LARGEST_SPREAD):
        raise ValueError(f"{parameters}: a finite mean and a spread from 0 to {LARGEST_SPREAD} are needed")
    return parameters


def _hyperparameters(record: dict[str, Any]) -> dict[str, Any]:
    if "family" in record:
        raise ValueError(f"kernel family {record['family']!r} is not accepted, train the model again")
    values = {k: np.array(v, dtype=np.float64) if isinstance(v, list) else float(v) for k, v in record.items()}
    if not all(np.all(np.isfinite(value)) for value in values.values()):
        raise ValueError("a hyperparameter is not finite")
    return values
