# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

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
