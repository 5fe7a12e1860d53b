# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A simulator and fits less fine than for a user, where the errors are far below a test's noise."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import pytest

from push_predictor.models.gaussian_process.gp import Cost, Descent, Minimum
from push_predictor.reporting import canvas
from push_predictor.simulation import dynamics
from push_predictor.types import Array

TICKS = ("xtick.bottom", "xtick.labelbottom", "ytick.left", "ytick.labelleft")


@contextmanager
def coarse_simulator(factor: float) -> Iterator[None]:
    """The steps of a simulated push are longer by a factor."""
    with patch.object(dynamics, "TRAVEL_STEP", factor * dynamics.TRAVEL_STEP):
        yield


@contextmanager
def coarse_fits(steps: int = 3) -> Iterator[None]:
    """Every search for hyperparameters ends after few steps."""
    whole = Descent.run

    def begun(self: Descent, cost: Cost, first: Array, unit: float = 1.0) -> Minimum:
        return whole(replace(self, most_iterations=steps), cost, first, unit)

    with patch.object(Descent, "run", begun):
        yield


@contextmanager
def coarse_pictures() -> Iterator[None]:
    """Pictures in a quarter of the time: few pixels, no ticks, axes and labels that are not fitted to each other."""
    with patch.multiple(canvas, DPI=40, LAYOUTS=0), patch.dict(canvas.STYLE, dict.fromkeys(TICKS, False)):
        yield


@pytest.fixture(scope="module", autouse=True)
def coarsely() -> Iterator[None]:
    """For all tests of a folder whose conftest.py imports it."""
    with coarse_simulator(4.0):
        yield
