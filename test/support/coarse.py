# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A simulator less fine than for a user, where the errors are far below a test's noise."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import pytest

from push_predictor.simulation import dynamics


@contextmanager
def coarse_simulator(factor: float) -> Iterator[None]:
    """The steps of a simulated push are longer by a factor."""
    with patch.object(dynamics, "TRAVEL_STEP", factor * dynamics.TRAVEL_STEP):
        yield


@pytest.fixture(scope="module", autouse=True)
def coarsely() -> Iterator[None]:
    """For all tests of a folder whose conftest.py imports it."""
    with coarse_simulator(4.0):
        yield
