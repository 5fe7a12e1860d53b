# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models are trained and pushes simulated coarsely: the claims are tested here, both in test/models and simulation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from importlib.util import find_spec

import pytest
from coarse import coarse_fits, coarse_simulator

# rosdep has no key of diptest: `colcon test` goes without the tests of the paper's package, unless pip installed it.
collect_ignore_glob = [] if find_spec("diptest") else ["test_*.py"]


@pytest.fixture(scope="module", autouse=True)
def coarse_models(request: pytest.FixtureRequest) -> Iterator[None]:
    """Half of a section's time. The fits of the whole report are as they are."""
    whole_report = request.module.__name__ == "test_paper_report"
    with nullcontext() if whole_report else coarse_fits(), coarse_simulator(3.0):
        yield
