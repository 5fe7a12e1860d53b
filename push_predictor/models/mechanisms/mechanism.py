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

"""Definition of a mechanism: physical parameters and the response of an outcome to each of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.types import Array, BoolArray, IntArray


@dataclass(frozen=True)
class Parameter:
    """A physical quantity with its unit; it is zero in the base model.

    largest: largest absolute value that a rig can have. A fit that needs more mimics something else.
    """

    name: str
    unit: str
    largest: float


@dataclass(frozen=True, eq=False)
class Push:
    """n pushes: inputs (n, 3: velocity m/s, contact, angle rad), duration (n,) s, covariates (n,) each by name."""

    inputs: Array
    duration: Array
    covariates: Mapping[str, Array]

    def take(self, rows: IntArray | BoolArray | slice) -> Push:
        """Some of these pushes."""
        covariates = {name: column[rows] for name, column in self.covariates.items()}
        return Push(self.inputs[rows], self.duration[rows], covariates)


@dataclass(frozen=True)
class Mechanism:
    """A mechanism that the base model lacks, or has with another value.

    response(physics, push) -> (n, 3, p): derivative of the outcome (dx, dy in m, dtheta in rad, push frame) with
    respect to each of the p parameters, at the physics given. needs: covariates that the response itself depends on, in
    addition to those of its basis. quantities: parameters of the forward model (models/mechanics/parameters.py) that
    the p parameters change, so that its effects are exact; none if the forward model lacks them.
    """

    name: str
    parameters: tuple[Parameter, ...]
    response: Callable[[AnalyticalPush, Push], Array]
    needs: tuple[str, ...] = ()
    quantities: tuple[str, ...] = ()

    def plausible(self, values: Array) -> bool:
        """Whether a rig could have these values (n, p) of the parameters."""
        return bool(np.all(np.abs(values) <= [parameter.largest for parameter in self.parameters]))
