# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models are trained and pushes simulated coarsely: the claims are tested here, both in test/models and simulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec

import pytest
from coarse import coarse_simulator

from push_predictor.models.gaussian_process.gp import Cost, Descent, Minimum
from push_predictor.types import Array

# rosdep has no key of diptest: `colcon test` goes without the tests of the paper's package, unless pip installed it.
collect_ignore_glob = [] if find_spec("diptest") else ["test_*.py"]


@pytest.fixture(scope="module", autouse=True)
def coarse_models(request: pytest.FixtureRequest) -> Iterator[None]:
    """End every search for hyperparameters after few steps: half of a section's time. The whole report is as it is."""
    whole = Descent.run

    def begun(self: Descent, cost: Cost, first: Array, unit: float = 1.0) -> Minimum:
        return whole(replace(self, most_iterations=3), cost, first, unit)

    with pytest.MonkeyPatch.context() as coarse:
        if request.module.__name__ != "test_paper_report":
            coarse.setattr(Descent, "run", begun)
        with coarse_simulator(3.0):
            yield
