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
