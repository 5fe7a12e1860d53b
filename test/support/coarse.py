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

"""Mechanics and simulator less fine than for a user, where the errors are far below a test's noise."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from push_predictor.models.mechanics import analytical, fitted, forward
from push_predictor.models.mechanics.scalar import push
from push_predictor.simulation import dynamics


@contextmanager
def coarse_mechanics() -> Iterator[None]:
    """A displacement by the analytical model is accurate to 0.1 %, in a fifth of the time."""
    with patch.object(analytical, "ACCURACY", 1e-3):
        yield


@contextmanager
def coarse_effects() -> Iterator[None]:
    """As coarse_mechanics, and what an effect shifts is accurate to 1 %."""
    with coarse_mechanics(), patch.object(fitted, "ACCURACY_OF_SHIFT", 1e-2):
        yield


@contextmanager
def coarse_sweeps() -> Iterator[None]:
    """All displacements are accurate to 1 %, those of fits and of draws too, in about half the time."""
    as_arrays, as_numbers = forward.swept, push.swept

    def swept(rate_of: Any, travel: Any, length: Any, accuracy: float) -> Any:
        return as_arrays(rate_of, travel, length, max(accuracy, 1e-2))

    def swept_alone(rate: Any, travel: float, length: float, accuracy: float) -> Any:
        return as_numbers(rate, travel, length, max(accuracy, 1e-2))

    with coarse_mechanics(), patch.object(forward, "swept", swept), patch.object(push, "swept", swept_alone):
        yield


@contextmanager
def coarse_simulator(factor: float) -> Iterator[None]:
    """The steps of a simulated push are longer by a factor."""
    with patch.object(dynamics, "TRAVEL_STEP", factor * dynamics.TRAVEL_STEP):
        yield
