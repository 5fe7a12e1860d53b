# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes are integrated and simulated less finely than for a user: the errors are far below these tests' noise."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from coarse import coarse_simulator


@pytest.fixture(scope="module", autouse=True)
def coarsely() -> Iterator[None]:
    """For all tests of this folder."""
    with coarse_simulator(4.0):
        yield
