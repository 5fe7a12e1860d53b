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

"""Models are trained coarsely: the claims are tested here, training in test/models."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec

import pytest

from push_predictor.models.gaussian_process.descent import Cost, Descent, Minimum
from push_predictor.types import Array

# rosdep has no key of diptest: `colcon test` goes without the tests of the paper's package, unless pip installed it.
collect_ignore_glob = [] if find_spec("diptest") else ["test_*.py"]


@pytest.fixture(scope="module", autouse=True)
def coarse_models(request: pytest.FixtureRequest) -> Iterator[None]:
    """End every search for hyperparameters after few steps: half of a section's time. The whole report is as it is."""
    whole = Descent.run

    def begun(self: Descent, cost: Cost, first: Array, unit: Array | float = 1.0) -> Minimum:
        return whole(replace(self, most_iterations=3), cost, first, unit)

    with pytest.MonkeyPatch.context() as coarse:
        if request.module.__name__ != "test_paper_report":
            coarse.setattr(Descent, "run", begun)
        yield
