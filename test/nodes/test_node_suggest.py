# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The action suggest_pushes of predict_server."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_harness as harness
from action_bench import ActionGoal
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile
from server_bench import hosted_server_of
from synthetic import square_pushes

from push_predictor.design.batch import Suggested, suggest_pushes
from push_predictor.design.limits import Limits
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor_interfaces.action import SuggestPushes

Ask = Callable[..., SuggestPushes.Result]
ARRAYS = ("velocity", "contact", "angle", "duration", "variance_left")
LIMITS = {"speed": [0.02, 0.04], "angle": [-0.3, 0.5], "travel": 0.02, "excluded": [0.2, 0.4, 0.9, 0.1]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two GPs of the square."""
    place = tmp_path_factory.mktemp("models")
    for seed, name in enumerate(("gp", "other")):
        options = TrainingOptions(mean="zero")
        save_model(train_model(*square_pushes(30, seed), "gp", name=name, options=options), place / f"{name}.model")
    return place


@pytest.fixture(scope="module")
def begin(folder: Path) -> Iterator[Callable[..., ActionGoal]]:
    """A function from the fields of a goal to the goal."""
    with hosted_server_of([folder], default_model="gp") as server:
        feedback = QoSProfile(depth=100)
        client = ActionClient(server.node, SuggestPushes, "suggest_pushes", feedback_sub_qos_profile=feedback)
        harness.acquaint(server.node, "push_predictor")
        yield lambda **fields: ActionGoal(server.node, client, SuggestPushes.Goal(**{"count": 2, **fields}))


@pytest.fixture
def ask(begin: Callable[..., ActionGoal]) -> Ask:
    """A function from the fields of a goal to the result; a refused goal is aborted."""

    def result(**fields: Any) -> SuggestPushes.Result:
        status, result = begin(**fields).end()
        assert status == (GoalStatus.STATUS_SUCCEEDED if result.success else GoalStatus.STATUS_ABORTED)
        return result

    return result


def assert_equal(response: SuggestPushes.Result, expected: Suggested) -> None:
    assert response.success, response.message
    columns = (*expected.inputs.T, expected.duration, expected.variance_left)
    for name, column in zip(ARRAYS, columns, strict=True):
        np.testing.assert_allclose(getattr(response, name), column, rtol=1e-6)


def test_response_equals_the_librarys_pushes(ask: Ask, folder: Path) -> None:
    assert_equal(ask(), suggest_pushes(load_model(folder / "gp.model"), 2))


def test_limits_and_seed_are_those_of_the_request(ask: Ask, folder: Path) -> None:
    limits = Limits((0.02, 0.04), (-0.3, 0.5), 0.02, ((0.2, 0.4), (0.9, 0.1)), 0.05)
    expected = suggest_pushes(load_model(folder / "other.model"), 2, limits, seed=2**63)
    response = ask(model="other", transfer_speed=0.05, seed=2**63, **LIMITS)
    assert_equal(response, expected)
    assert list(response.contact) != list(ask(model="other", seed=2**63, **LIMITS).contact)


def test_one_goal_at_a_time_tells_its_progress_until_it_is_cancelled(
    begin: Callable[..., ActionGoal], ask: Ask
) -> None:
    """test_node_long_requests has what else the server does meanwhile."""
    goal = begin(count=200)
    refused = ask(count=1)
    assert refused.error_code == refused.BUSY and "one at a time" in refused.message and not goal.ended
    assert harness.wait_until(lambda: len(goal.feedback) > 1)
    assert [each.chosen for each in goal.feedback] == list(range(1, len(goal.feedback) + 1))
    goal.handle.cancel_goal_async()
    status, result = goal.end()
    assert (status, result.error_code) == (GoalStatus.STATUS_CANCELED, result.CANCELLED)
    assert "cancelled" in result.message and not len(result.velocity)
    assert ask(count=1).success
