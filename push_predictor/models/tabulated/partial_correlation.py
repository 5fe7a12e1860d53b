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

The compiled `spline.table_moments` turns them back. They are atanh of r12, of r13 and of the partial correlation
r23.1. Any three numbers give a positive definite matrix. An error e in one of them changes the variance of any
combination of outputs by at most about 2 e (relative), however close to +-1 the correlation is.
"""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array

_LARGEST = 1.0 - 1e-12


def unbounded(correlation: Array) -> Array:
    """The three numbers (m, 3) of correlation matrices (m, 3, 3)."""
    r12, r13, r23 = correlation[:, 0, 1], correlation[:, 0, 2], correlation[:, 1, 2]
    partial = (r23 - r12 * r13) / np.sqrt((1.0 - r12**2) * (1.0 - r13**2))
    return np.arctanh(np.clip(np.column_stack([r12, r13, partial]), -_LARGEST, _LARGEST))
