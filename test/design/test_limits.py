# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The limits of a robot: what is refused, and which contacts may be pushed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic import square_pushes

from push_predictor.design.limits import Limits
from push_predictor.errors import RequestError
from push_predictor.models.push_model import USUAL_SPEED, PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.table import empty_table


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("speed", (0.0, 0.1)),
        ("speed", (0.1, 0.05)),
        ("speed", (0.1, np.inf)),
        ("speed", (np.nan, 0.1)),
        ("speed", (1e-310, 0.1)),
        ("speed", (0.03 / 601.0, 0.1)),
        ("angle", (-1.6, 0.0)),
        ("angle", (0.0, 1.6)),
        ("angle", (0.5, 0.4)),
        ("travel", 0.0),
        ("travel", 1.1),
        ("transfer_speed", 0.0),
        ("transfer_speed", np.inf),
        ("excluded", ((-0.1, 0.2),)),
        ("excluded", ((0.1, 1.2),)),
        ("excluded", ((0.0, 0.995),)),
    ],
)
def test_a_value_out_of_range_is_refused_by_name(field: str, value: Any) -> None:
    with pytest.raises(RequestError, match=field):
        Limits(**{field: value})


def test_a_push_may_last_ten_minutes_and_a_window_be_a_metre_long() -> None:
    table, rig = square_pushes(30)
    model = train_model(table, rig, "analytical", name="m")
    fastest = 1.0 / model.usual_duration
    limits = Limits(speed=(0.03 / 599.0, 0.999 * fastest))
    assert limits.ranges(model)[0] == limits.speed
    with pytest.raises(RequestError, match=r"speed.*at most 5 m/s"):
        Limits(speed=(0.1, 1.001 * fastest)).ranges(model)


def test_excluded_contacts_are_not_allowed() -> None:
    limits = Limits(excluded=((0.2, 0.3), (0.9, 0.1)))
    contact = np.array([0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.85, 0.9, 0.95])
    allowed = [False, False, False, True, False, False, False, True, True, False, False]
    assert limits.allows(contact).tolist() == allowed


def test_by_default_speeds_are_those_of_training_and_angles_at_least_one_radian() -> None:
    table, rig = square_pushes(30)
    model = train_model(table, rig, "analytical", name="m")
    assert Limits().ranges(model) == ((0.02, 0.02), (-1.0, 1.0))
    model.training.inputs[0] = [0.01, 0.1, 1.3]
    assert Limits().ranges(model) == ((0.01, 0.02), (-1.0, 1.3))
    assert Limits(speed=(0.1, 0.2), angle=(-0.2, 0.1)).ranges(model) == ((0.1, 0.2), (-0.2, 0.1))


def test_an_untrained_model_is_pushed_at_the_usual_speed() -> None:
    corners = np.array([[0.04, 0.04, 0.5], [-0.04, 0.04, 0.25], [0.0, -0.04, 0.25]])  # a patch takes a second
    rig = replace(square_pushes(1)[1], support_points=corners)
    model: PushModel = train_model(empty_table(), rig, "prior", name="m")
    assert Limits().ranges(model) == ((USUAL_SPEED, USUAL_SPEED), (-1.0, 1.0))
