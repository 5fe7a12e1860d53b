# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings and tables of one simulated motion: sensors and their errors do not change it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any
from unittest.mock import patch

from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.simulation import outcomes, rig_simulator
from push_predictor.simulation.batches import Batch, run_pushes
from push_predictor.simulation.spec import SimulationSpec


def sensed(spec: SimulationSpec, **sensing: Any) -> Recording:
    """The recording of a spec, with other sensors or faults of them."""
    with patch.object(rig_simulator, "run_pushes", lambda _: iter(_batches(spec))):
        return rig_simulator.simulate(replace(spec, **sensing))


def outcomes_of(spec: SimulationSpec) -> PushTable:
    """The true outcomes of a spec."""
    with patch.object(outcomes, "run_pushes", lambda _: iter(_batches(spec))):
        return outcomes.push_outcomes(spec)


@cache  # a spec is equal only to itself
def _batches(spec: SimulationSpec) -> list[Batch]:
    return list(run_pushes(spec))
