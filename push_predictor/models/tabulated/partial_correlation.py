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

"""Correlation matrices of three outputs as three unbounded numbers, which a table can interpolate.

They are atanh of r12, of r13 and of the partial correlation r23.1. Any three numbers give a positive definite matrix.
An error e in one of them changes the variance of any combination of outputs by at most about 2 e (relative), however
close to +-1 the correlation is.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt, tanh

import numpy as np

from push_predictor.types import Array

_LARGEST = 1.0 - 1e-12
_PLACES = np.array([[0, 1, 2], [1, 0, 3], [2, 3, 0]])


def unbounded(correlation: Array) -> Array:
    """The three numbers (m, 3) of correlation matrices (m, 3, 3)."""
    r12, r13, r23 = correlation[:, 0, 1], correlation[:, 0, 2], correlation[:, 1, 2]
    partial = (r23 - r12 * r13) / np.sqrt((1.0 - r12**2) * (1.0 - r13**2))
    return np.arctanh(np.clip(np.column_stack([r12, r13, partial]), -_LARGEST, _LARGEST))


def bounded(numbers: Array) -> Array:
    """Correlation matrices (n, 3, 3) of the three numbers (n, 3)."""
    r12, r13, partial = np.tanh(numbers.T)
    r23 = r12 * r13 + partial * np.sqrt((1.0 - r12**2) * (1.0 - r13**2))
    return np.asarray(np.stack([np.ones(len(numbers)), r12, r13, r23], axis=-1)[:, _PLACES])


def bounded_one(numbers: Sequence[float]) -> tuple[float, float, float]:
    """r12, r13 and r23 of the three numbers."""
    r12, r13, partial = tanh(numbers[0]), tanh(numbers[1]), tanh(numbers[2])
    return r12, r13, r12 * r13 + partial * sqrt((1.0 - r12 * r12) * (1.0 - r13 * r13))
