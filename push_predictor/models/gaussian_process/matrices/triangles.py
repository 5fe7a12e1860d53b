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

"""Symmetric matrices of which only the upper triangle is computed, block by block to stay in the cache."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from push_predictor.types import Array

BLOCK = 64


def upper_blocks(n: int) -> Iterator[tuple[slice, slice]]:
    """Rows and columns of blocks that cover the upper triangle of an (n, n) matrix, each with its square in front."""
    for start in range(0, n, BLOCK):
        yield slice(start, min(start + BLOCK, n)), slice(start, n)


def mirror_upper(matrix: Array) -> Array:
    """The symmetric matrix of an upper triangle (n, n), in its memory."""
    for rows, _ in upper_blocks(len(matrix)):
        square = matrix[rows, rows]
        square[:] = np.triu(square) + np.triu(square, 1).T
        matrix[rows.stop :, rows] = matrix[rows, rows.stop :].T
    return matrix
