# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service predict_slider_pose of predict_server: the slider after a push, in the frame of the request."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_harness as harness
import yaml
from server_bench import hosted_server_of
from synthetic import square_pushes

from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.slider_pose import WorldPush, slider_after
from push_predictor_interfaces.srv import PredictSliderPose

EXAMPLE = """{header: {frame_id: world}, slider: {position: {x: 0.3, y: 0.1}, orientation: {w: 1.0}},
  pusher: {x: 0.25025, y: 0.11}, pusher_velocity: {x: 0.02, y: 0.002}, duration: 0.2}"""
PUSH = WorldPush(np.array([0.3, 0.1, 0.0]), np.array([0.25025, 0.11]), np.array([0.02, 0.002]), 0.2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A learned model of the square."""
    place, rng = tmp_path_factory.mktemp("models"), np.random.default_rng(0)
    table, rig = square_pushes(60)
    shared = rng.standard_normal((60, 1)) * [1e-4, 2e-4, 5e-3]  # so that the outputs are correlated
    table = replace(table, outcomes=table.outcomes + shared, inputs=table.inputs + rng.random((60, 1)) * [2e-4, 0, 0])
    save_model(train_model(table, rig, "gp", name="gp", options=TrainingOptions(mean="zero")), place / "gp.model")
    return place


@contextlib.contextmanager
def server_of(folder: Path, **params: Any) -> Iterator[Any]:
    """Run the server; yield a function from changes of EXAMPLE to the response."""
    with hosted_server_of([folder], **params) as server:
        client = server.node.create_client(PredictSliderPose, "predict_slider_pose")

        def ask(**change: Any) -> PredictSliderPose.Response:
            return harness.call(client, filled(PredictSliderPose.Request(), {**yaml.safe_load(EXAMPLE), **change}))

        yield ask


@pytest.fixture(scope="module")
def ask(folder: Path) -> Iterator[Any]:
    with server_of(folder) as asked:
        yield asked


def filled(message: Any, values: dict[str, Any]) -> Any:
    """A message from nested values, as `ros2 service call` fills it."""
    for name, value in values.items():
        setattr(message, name, filled(getattr(message, name), value) if isinstance(value, dict) else value)
    return message


def test_response_equals_the_librarys_prediction(ask: Any, folder: Path) -> None:
    response = ask(model="gp")
    expected = slider_after(tabulate(load_model(folder / "gp.model")), PUSH)
    assert response.success, response.message
    assert response.in_domain == expected.in_domain
    pose = response.slider_after.pose
    np.testing.assert_allclose([pose.pose.position.x, pose.pose.position.y], expected.pose[:2], rtol=1e-12)
    turn = pose.pose.orientation
    assert 2.0 * np.arctan2(turn.z, turn.w) == pytest.approx(expected.pose[2], rel=1e-9)
    planar = np.ix_([0, 1, 5], [0, 1, 5])
    np.testing.assert_allclose(np.array(pose.covariance).reshape(6, 6)[planar], expected.covariance, rtol=1e-9)
    assert response.slider_after.header.frame_id == "world"


def test_example_is_in_the_domain_and_moves_the_slider(ask: Any) -> None:
    response = ask()
    assert response.in_domain
    assert 0.002 < response.slider_after.pose.pose.position.x - 0.3 < 0.006


def test_world_frame_has_the_name_from_the_parameter(folder: Path) -> None:
    with server_of(folder, world_frame="table") as ask:
        assert ask(header={"frame_id": "table"}).slider_after.header.frame_id == "table"
        assert "give 'table'" in ask(header={"frame_id": "world"}).message
