# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes are integrated and simulated less finely than for a user: the errors are far below these tests' noise."""

from __future__ import annotations

import pytest
from coarse import coarsely
from made_up_traces import pushes
from search_bench import in_library
from synthetic import square_rig

from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model

__all__ = ["coarsely"]


@pytest.fixture(scope="session")
def deployed() -> PushModel:
    """An analytical model of pushes without effects."""
    return train_model(pushes(100, 1), square_rig(), "analytical", name="deployed")


@pytest.fixture(autouse=True)
def library_of_the_file(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the mechanisms that a file names as TRIED are in the library: responses take most of the time."""
    if tried := getattr(request.module, "TRIED", ()):
        in_library(monkeypatch, *tried)
