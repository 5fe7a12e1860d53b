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

"""The figures are drawn coarsely. test_report draws and lays out figures as a reader sees them."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import pytest

# rosdep has no key of diptest: `colcon test` goes without the tests of the paper's package, unless pip installed it.
collect_ignore_glob = [] if find_spec("diptest") else ["test_*.py"]


@pytest.fixture(scope="module", autouse=True)
def coarse_pictures() -> Iterator[None]:
    """Draw few pixels and do not fit axes and labels: of a section's time each takes a quarter."""
    with pytest.MonkeyPatch.context() as coarse:
        coarse.setattr("push_predictor.reporting.canvas.DPI", 40)
        coarse.setattr("push_predictor.reporting.canvas.LAYOUTS", 0)
        yield
