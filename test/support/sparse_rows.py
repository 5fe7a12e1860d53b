# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rows that the tests of the sparse VHGP share, and hyperparameters for them."""

from __future__ import annotations

import numpy as np

from push_predictor.models.gaussian_process.bound import VhgpParameters
from push_predictor.types import Array

PARAMETERS = VhgpParameters(np.array([0.1, -0.2]), 0.2, np.array([0.3, 0.1]), -0.1, -1.0, -0.8)


def rows(n: int, seed: int = 0) -> tuple[Array, Array]:
    """A sine of the first input, with noise whose standard deviation is exp(second input - 1)."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(n, 2))
    return inputs, np.sin(inputs[:, 0]) + rng.normal(size=n) * np.exp(inputs[:, 1] - 1.0)
