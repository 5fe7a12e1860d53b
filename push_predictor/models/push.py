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

"""n pushes as columns: what every prediction starts from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from push_predictor.types import Array, BoolArray, IntArray


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
