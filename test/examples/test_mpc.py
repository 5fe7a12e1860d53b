# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sampling MPC: what it prefers, and its loop with a server over DDS. The rig that it pushes on."""

from __future__ import annotations

import re

import numpy as np
import pytest
import ros_harness as harness
from geometry_msgs.msg import PoseStamped

from examples import mpc
from examples.planner_client import PlannerClient
from examples.square import TABLE, TRAINING, square_spec
from msg_adapters.predictions import RefusedError
from push_predictor.errors import RequestError
from push_predictor.geometry.frames import to_world
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.prediction import Prediction
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.tip_paths import SliderPaths
from push_predictor.planning.unscented import PusherGeometry
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.simulation.interactive_rig import LiveRig

SQUARE, ONLY = shape_outline("rect1"), np.array([0])
PUSHER, FREE = PusherGeometry(SQUARE, 0.00475, 0.1), Scene(SQUARE, TABLE)
NOISE = np.diag([2e-4, 2e-4, 5e-3]) ** 2


def carried(inputs, known=True) -> Prediction:
    """A slider that goes where the tip goes."""
    n = len(inputs)
    mean = np.column_stack([PUSHER.window * inputs[:, 0], np.zeros((n, 2))])
    return Prediction(mean, np.tile(NOISE, (n, 1, 1)), np.tile(NOISE, (n, 1, 1)), np.full(n, known))


class Recorded(mpc.SamplingMpc):
    """Keeps the last samples and their costs."""

    def _rolled(self, slider, tip, samples, keep):
        cost, paths = super()._rolled(slider, tip, samples, keep)
        self.last = samples, cost.copy()
        return cost, paths


def test_the_plan_is_the_mean_of_the_samples_weighted_by_their_costs():
    planner = Recorded(carried, PUSHER, Goal([0.05, 0.0, 0.0], 0.002), FREE)
    plan = planner.plan(np.zeros(3), None)
    samples, cost = planner.last
    weight = np.exp(-(cost - cost.min()) / mpc.TEMPERATURE)
    np.testing.assert_allclose(plan.window, weight @ samples[:, 0] / weight.sum(), rtol=1e-9)
    assert plan.place and np.cos(plan.window[2]) > 0.9


def test_a_tip_keeps_its_contact_where_it_pushes_to_the_goal_and_is_placed_where_it_cannot():
    behind, before = (np.array([side * (0.045 + PUSHER.radius), 0.0]) for side in (-1.0, 1.0))
    planner = mpc.SamplingMpc(carried, PUSHER, Goal([0.03, 0.0, 0.0], 0.002), FREE)
    assert [planner.plan(np.zeros(3), tip).place for tip in (None, behind, before)] == [True, False, True]


def test_the_cost_is_the_expected_distance_a_miss_and_the_time_of_the_best_window():
    far, steps = Goal([1.0, 0.0, 0.0], 0.002, 0.05), len(mpc.STEPS)
    planner = mpc.SamplingMpc(carried, PUSHER, far, Scene(SQUARE, 1e6 * TABLE))
    variances = np.diag([0.3, 0.2, 0.1 / SQUARE.polar_moment])
    for covariance, square in ((np.zeros((3, 3)), 1.0), (variances, 1.6)):
        paths = SliderPaths(np.zeros((1, steps, 3)), np.tile(covariance, (1, steps, 1, 1)), np.ones((1, steps), bool))
        assert planner.cost(paths) == pytest.approx(np.sqrt(square) / mpc.PACE + mpc.MISS + PUSHER.window, rel=1e-4)


def test_placing_the_tip_costs_time_and_the_samples_that_place_it_do_not_change_a_plan_that_keeps_it():
    tip = np.array([-0.045 - PUSHER.radius, 0.0])
    planner = Recorded(carried, PUSHER, Goal([0.05, 0.0, 0.0], 0.002), FREE)
    alike = np.tile([0.02, 0.125, 0.0], (2, len(mpc.STEPS), 1))
    assert np.diff(planner._rolled(np.zeros(3), tip, alike, 1)[0]) == pytest.approx(mpc.PLACING)
    kept = np.arange(mpc.SAMPLES) < mpc.SAMPLES // 2
    planner.cost = lambda paths: np.where(kept, mpc.PLACING, 1e-3)
    plan = planner.plan(np.zeros(3), tip)
    np.testing.assert_allclose(plan.window, planner.last[0][kept, 0].mean(axis=0))


@pytest.mark.parametrize("obstacle", [False, True])
def test_obstacles_are_avoided(obstacle):
    post = np.array([[0.07, 0.03], [0.09, 0.03], [0.09, 0.08], [0.07, 0.08]])
    scene = Scene(SQUARE, TABLE, [post])
    goal = Goal([0.16, 0.0, 0.0], 0.002)
    planner, slider, tip = mpc.SamplingMpc(carried, PUSHER, goal, scene if obstacle else FREE), np.zeros(3), None
    clearance = []
    while not goal.reached(goal.ahead(slider)) and len(clearance) < mpc.LIMIT:
        speed, _, heading = planner.plan(slider, tip).window
        step = PUSHER.window * speed * np.array([np.cos(heading), np.sin(heading)])
        slider = slider + [*step, 0.0]
        clearance.append(float(scene.clearance(slider)))
    assert goal.reached(goal.ahead(slider)) and (min(clearance) > 0.0) == obstacle


def test_a_model_without_a_known_sample_is_refused():
    planner = mpc.SamplingMpc(lambda inputs: carried(inputs, known=False), PUSHER, mpc.GOAL, FREE)
    with pytest.raises(RequestError, match="domain"):
        planner.plan(np.zeros(3), None)


class Ideal:
    """A rig whose slider goes where the tip goes, and a client that keeps what is published."""

    def __init__(self) -> None:
        self.sliders, self.tips, self.placed, self.published = mpc.START[None].copy(), np.zeros((1, 2)), [0], []

    def place(self, rows, contacts) -> None:
        self.placed = [self.placed[0] + 1]
        touch = SQUARE.point(contacts) - PUSHER.radius * SQUARE.inward_normal(contacts)
        self.tips = to_world(touch, self.sliders)

    def push(self, rows, speeds, headings, duration) -> None:
        step = duration * speeds[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
        self.sliders, self.tips = self.sliders + np.column_stack([step, [0.0]]), self.tips + step

    def stop(self, rows):
        return self.sliders

    def publish_poses(self, poses) -> None:
        self.published.append(poses)


def test_the_loop_plans_again_after_each_window_from_the_pose_that_came_of_it(monkeypatch):
    rig, seen = Ideal(), []
    planner = mpc.SamplingMpc(carried, PUSHER, goal := Goal([*mpc.GOAL.pose[:2], mpc.START[2]], 0.002, 0.05), FREE)
    monkeypatch.setattr(mpc, "GOAL", goal)
    plan, planner.plan = planner.plan, lambda slider, tip: seen.append((slider, tip)) or plan(slider, tip)
    windows = mpc.run(planner, rig, rig, PUSHER.window)
    assert goal.reached(goal.ahead(rig.sliders[0])) and len(windows) == len(seen) == len(rig.published) > 10
    np.testing.assert_array_equal(
        [slider for slider, _ in seen[1:]], [poses["slider/pose"] for poses in rig.published[:-1]]
    )
    assert seen[0][1] is None and all(tip is not None for _, tip in seen[1:])


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """Mechanics, for windows of 0.1 s."""
    path, recording = tmp_path_factory.mktemp("mpc") / "square.pushmodel", [TRAINING]
    rig = load_rig_for(recording)
    save_model(
        train_model(load_data(recording, rig, WindowOptions(duration=0.1)), rig, "analytical", name="square"), path
    )
    return path


@pytest.fixture
def domain(monkeypatch):
    """A ROS domain for this process and the nodes that it starts."""
    with harness.reserved_domain() as number:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield number


@pytest.mark.ros
@pytest.mark.slow
def test_the_example_reaches_its_goal_with_a_server_in_another_process(model, domain, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(mpc, "OUT", tmp_path)
    poses = []
    with harness.ros_context(domain) as node:
        node.create_subscription(PoseStamped, "slider/pose", poses.append, 1000)
        assert mpc.main(["--model", str(model)]) == 0
    assert re.search(r"Goal reached: \d+ windows, \d+ contacts.\nPlanning takes \d+ ms", capsys.readouterr().out)
    assert (tmp_path / "mpc.png").stat().st_size > 10_000
    assert len(poses) > 10 and poses[-1].header.frame_id == "world"


@pytest.mark.ros
def test_a_refusal_of_the_server_is_reported(model, domain):
    with (
        harness.node_process("predict_server", domain=domain, params={"models": [str(model)]}),
        PlannerClient(-1.0) as client,
    ):
        planner = mpc.SamplingMpc(client.predict, PUSHER, mpc.GOAL, FREE)
        with pytest.raises(RefusedError, match="duration: -1"):
            mpc.run(planner, LiveRig(square_spec(1), mpc.START[None]), client, PUSHER.window)
