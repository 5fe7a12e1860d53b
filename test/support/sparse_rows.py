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

"""Rows that the tests of the sparse VHGP share, and hyperparameters for them."""

from __future__ import annotations

import numpy as np

from push_predictor.models.gaussian_process.parameters import VhgpParameters
from push_predictor.types import Array

PARAMETERS = VhgpParameters(np.array([0.1, -0.2]), 0.2, np.array([0.3, 0.1]), -0.1, -1.0, -0.8)


def rows(n: int, seed: int = 0) -> tuple[Array, Array]:
    """A sine of the first input, with noise whose standard deviation is exp(second input - 1)."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(n, 2))
    return inputs, np.sin(inputs[:, 0]) + rng.normal(size=n) * np.exp(inputs[:, 1] - 1.0)
