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

"""The comparison of two traces: numbers by their relative difference, everything else by equality."""

from __future__ import annotations

import pytest

from benchmarks.blind.trace_time import difference


@pytest.mark.parametrize(
    ("one", "other", "apart"),
    [
        ({"a": [1.0, 2.0], "b": "none"}, {"a": [1.0, 2.0], "b": "none"}, 0.0),
        ({"a": [1.0, 2.0]}, {"a": [1.0, 2.5]}, 0.2),
        ([1e-5], [3e-5], 0.02),  # below SMALL
        ([float("nan")], [float("nan")], 0.0),
        ({"verdict": "none"}, {"verdict": "effect"}, None),
        ([1.0], [1.0, 1.0], None),
        ({"a": 1.0}, {"b": 1.0}, None),
        ({"a": None, "b": 2.0}, {"a": 1.0, "b": 2.0}, None),
    ],
)
def test_results_differ_by_their_numbers_or_altogether(one: object, other: object, apart: float | None) -> None:
    found = difference(one, other)
    assert found is None if apart is None else found == pytest.approx(apart)
