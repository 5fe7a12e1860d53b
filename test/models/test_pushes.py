# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes as a user states them: scalars, lists, arrays; anything else is rejected by field."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_predictor.errors import RequestError
from push_predictor.models.pushes import Pushes

VELOCITIES = st.lists(st.floats(1e-3, 0.2), min_size=1, max_size=5)


def test_scalars_make_one_push_of_default_duration():
    pushes = Pushes(0.02, 0.1, 0.3)
    np.testing.assert_array_equal(pushes.inputs, [[0.02, 0.1, 0.3]])
    np.testing.assert_array_equal(pushes.duration, [0.2])
    assert len(pushes) == 1 and pushes.covariates == {}


@given(VELOCITIES, st.sampled_from([list, tuple, np.array]))
def test_lists_tuples_and_arrays_mean_the_same_and_scalars_apply_to_all(
    velocity: list[float], kind: Callable[..., object]
):
    pushes = Pushes(kind(velocity), 0.1, angle=[0.3], duration=0.1, covariates={"dwell_time": 2})
    np.testing.assert_array_equal(pushes.inputs, [[v, 0.1, 0.3] for v in velocity])
    np.testing.assert_array_equal(pushes.duration, np.full(len(velocity), 0.1))
    np.testing.assert_array_equal(pushes.covariates["dwell_time"], np.full(len(velocity), 2.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("fast", 0.1, 0.3), r"velocity: \"'fast'\" is not accepted, give a number or a list of numbers"),
        ((0.02, np.nan, 0.3), "contact: nan is not accepted, give a finite number"),
        ((0.02, [0.1, np.inf], 0.3), r"contact\[1\]: inf is not accepted"),
        (
            (0.02, 0.1, np.zeros((2, 2))),
            r"angle: 'an array of shape \(2, 2\)' is not accepted",
        ),
        (
            ([0.02, 0.03], [0.1, 0.2, 0.3], 0.3),
            "velocity: '2 numbers' .* give one number, or 3 as in contact",
        ),
        ((0.02, [], 0.3), "contact: 'an empty list' is not accepted, give at least one number"),
        ((0.02, 0.1, 0.3, [0.2, 0.1], {"dwell_time": [1, 2, 3]}), "duration: '2 numbers'"),
        ((0.02, 0.1, 0.3, 0.2, {"dwell_time": None}), "covariate dwell_time"),
        ((0.02, 0.1, 0.3, 0.2, {"dwell_time": np.nan}), "covariate dwell_time: nan is not accepted"),
    ],
)
def test_rejects_invalid_push_by_field_and_value(arguments: tuple[Any, ...], message: str):
    with pytest.raises(RequestError, match=message):
        Pushes(*arguments)
