# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service rollout_pushes of predict_server, and the frame of its poses and samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_harness as harness
from geometry_msgs.msg import PoseWithCovariance
from server_bench import hosted_server_of
from synthetic import square_pushes

from msg_adapters.slider_poses import fill_rollout_response, steps_from_request, world_start
from push_predictor.errors import RequestError
from push_predictor.geometry.frames import SAME_FRAME, SpatialPose, quaternion_of_yaw, vertical_turn, yaw_of_quaternion
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import train_model
from push_predictor.planning.rollout import FARTHEST, PARTICLES, rollout
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushStep
from push_predictor_interfaces.srv import RolloutPushes

SLIDER = np.array([0.3, -0.1, 2.5])
COVARIANCE = np.array([[4e-6, 1e-6, 2e-6], [1e-6, 2e-6, 0.0], [2e-6, 0.0, 4e-4]])
STEPS = [[0.02, 0.1, 0.1, 1.0], [0.02, 0.6, -0.2, 0.4]]
PLANAR = np.ix_([0, 1, 5], [0, 1, 5])
Ask = Callable[..., RolloutPushes.Response]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A GP of the square."""
    place = tmp_path_factory.mktemp("models")
    save_model(train_model(*square_pushes(60), "gp", name="gp"), place / "gp.model")
    return place


@pytest.fixture(scope="module")
def ask(folder: Path) -> Iterator[Ask]:
    """A function from changes of the usual request to the response."""
    with hosted_server_of([folder]) as server:
        client = server.node.create_client(RolloutPushes, "rollout_pushes")
        yield lambda **change: harness.call(client, request(**change))


def request(
    slider: Array = SLIDER,
    covariance: Array = COVARIANCE,
    steps: list[list[float]] = STEPS,
    frame: str = "world",
    **others: Any,
) -> RolloutPushes.Request:
    message = RolloutPushes.Request(slider=pose_with_covariance(slider, covariance), **others)
    message.header.frame_id = frame
    names = ("velocity", "contact", "angle", "duration")
    message.steps = [PushStep(**dict(zip(names, map(float, step), strict=True))) for step in steps]
    return message


def pose_with_covariance(slider: Array, covariance: Array) -> PoseWithCovariance:
    message, matrix = PoseWithCovariance(), np.zeros((6, 6))
    matrix[PLANAR] = covariance
    message.covariance = matrix.ravel()
    message.pose.position.x, message.pose.position.y, message.pose.position.z = *slider[:2], 0.03
    z, w = quaternion_of_yaw(slider[2])
    message.pose.orientation.z, message.pose.orientation.w = float(z), float(w)
    return message


def planar(pose: PoseWithCovariance) -> tuple[Array, Array]:
    """x, y, heading (3,) and their covariance (3, 3)."""
    place, turn = pose.pose.position, pose.pose.orientation
    matrix = np.array(pose.covariance).reshape(6, 6)[PLANAR]
    return np.array([place.x, place.y, yaw_of_quaternion(turn.x, turn.y, turn.z, turn.w)]), matrix


def test_response_equals_the_librarys_rollout(ask: Ask, folder: Path) -> None:
    response = ask(particles=7, seed=11)
    assert response.success, response.message
    expected = rollout(tabulate(load_model(folder / "gp.model")), SLIDER, COVARIANCE, STEPS, PARTICLES, 11)
    for pose, mean, covariance in zip(response.poses, expected.mean, expected.covariance, strict=True):
        found, matrix = planar(pose)
        np.testing.assert_allclose(found, mean, atol=1e-9)
        np.testing.assert_allclose(matrix, covariance, rtol=1e-6, atol=1e-12)
        assert pose.pose.position.z == pytest.approx(0.03)
    np.testing.assert_allclose(np.reshape(response.samples, (7, 3)), expected.samples[:7], atol=1e-9)


def test_poses_do_not_depend_on_the_number_of_samples(ask: Ask) -> None:
    none, some = ask(seed=3), ask(particles=200, seed=3)
    assert len(none.samples) == 0 and len(some.samples) == 600
    assert none.poses == some.poses
    many = ask(particles=3000, seed=3)
    assert len(many.samples) == 9000
    samples = np.reshape(many.samples, (-1, 3))
    np.testing.assert_allclose(samples[:, :2].mean(axis=0), planar(many.poses[-1])[0][:2], atol=1e-12)


def test_same_seed_gives_the_same_response_and_no_steps_give_no_poses(ask: Ask) -> None:
    one, again, other = (ask(particles=5, seed=seed) for seed in (2**63, 2**63, 1))
    assert one == again and one.samples != other.samples
    still = ask(steps=[], particles=4)
    assert still.success and still.poses == [] and len(still.samples) == 12


def test_message_reports_samples_that_leave_the_domain(ask: Ask) -> None:
    assert ask(covariance=np.zeros((3, 3)), steps=[[0.02, 0.1, 0.1, 0.2]]).message == ""
    response = ask(steps=[STEPS[0], [0.5, 0.1, 0.1, 0.2]])
    assert response.success
    expected = "out of domain: 100 % of the samples leave the domain of the training data, from steps[1] on"
    assert response.message.startswith(expected)


@pytest.mark.parametrize("quaternion", [vertical_turn(0.7), np.array([0.6, 0.8, 0.0, 0.0])], ids=["turned", "below"])
def test_poses_and_samples_are_in_the_frame_of_the_request(folder: Path, quaternion: Array) -> None:
    """A request in another frame, such as that of a camera below the table, gets the same outcome in that frame."""
    model, frame = load_model(folder / "gp.model"), SpatialPose(np.array([1.0, -2.0, 0.5]), quaternion)
    in_world = answered(model, request(particles=3), SAME_FRAME)
    in_frame = answered(model, seen_in(frame, request(particles=3)), frame)
    for one, other in zip(in_world.poses, in_frame.poses, strict=True):
        back, expected = frame @ pose_in_space(other), pose_in_space(one)
        np.testing.assert_allclose(back.position, expected.position, atol=1e-9)
        np.testing.assert_allclose(back.rotation, expected.rotation, atol=1e-9)
        covariance = frame.covariance(np.array(other.covariance).reshape(6, 6))
        np.testing.assert_allclose(covariance, np.array(one.covariance).reshape(6, 6), atol=1e-12)
    height = in_frame.poses[0].pose.position.z
    samples = zip(np.reshape(in_world.samples, (-1, 3)), np.reshape(in_frame.samples, (-1, 3)), strict=True)
    for (x, y, heading), (u, v, turned) in samples:
        np.testing.assert_allclose(frame.point(np.array([u, v, height])), [x, y, 0.03], atol=1e-9)
        ahead = frame.vector(np.array([np.cos(turned), np.sin(turned), 0.0]))
        np.testing.assert_allclose(ahead, [np.cos(heading), np.sin(heading), 0.0], atol=1e-9)


def test_rejects_slider_too_far_away() -> None:
    message = request()
    message.slider.pose.position.x = -2.0 * FARTHEST
    with pytest.raises(RequestError, match=r"slider\.pose\.position: .* give a place within"):
        world_start(message, SAME_FRAME)


def answered(model: PushModel, message: RolloutPushes.Request, frame: SpatialPose) -> RolloutPushes.Response:
    """The response to a request whose frame has the pose `frame` in the world."""
    response, (slider, covariance) = RolloutPushes.Response(), world_start(message, frame)
    rolled = rollout(model, slider.planar, covariance, steps_from_request(message)[0], 200, message.seed)
    fill_rollout_response(response, frame, slider, rolled, message.particles)
    return response


def seen_in(frame: SpatialPose, message: RolloutPushes.Request) -> RolloutPushes.Request:
    """A request in the world frame, transformed into another frame."""
    there = frame.inverse @ pose_in_space(message.slider)
    position, turn = message.slider.pose.position, message.slider.pose.orientation
    position.x, position.y, position.z = there.position.tolist()
    turn.x, turn.y, turn.z, turn.w = there.quaternion.tolist()
    matrix = np.array(message.slider.covariance).reshape(6, 6)
    message.slider.covariance = frame.inverse.covariance(matrix).ravel()
    return message


def pose_in_space(message: PoseWithCovariance) -> SpatialPose:
    place, turn = message.pose.position, message.pose.orientation
    return SpatialPose(np.array([place.x, place.y, place.z]), np.array([turn.x, turn.y, turn.z, turn.w]))
