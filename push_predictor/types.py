# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Aliases of array types for signatures."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
ByteArray: TypeAlias = NDArray[np.uint8]
TextArray: TypeAlias = NDArray[np.str_]
