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

"""A simulator less fine than for a user, where the errors are far below a test's noise."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from push_predictor.simulation import dynamics


@contextmanager
def coarse_simulator(factor: float) -> Iterator[None]:
    """The steps of a simulated push are longer by a factor."""
    with patch.object(dynamics, "TRAVEL_STEP", factor * dynamics.TRAVEL_STEP):
        yield
