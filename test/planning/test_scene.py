# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which poses are safe in a scene, and which are in a target."""

from __future__ import annotations

import numpy as np
import pytest

from push_predictor.errors import RequestError
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.prediction import Prediction
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.cost_to_go import cost_to_go
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import Overhang, PoseTarget
from push_predictor.planning.tip_paths import slider_paths
from push_predictor.planning.unscented import PusherGeometry

TABLE = np.array([[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]])
BLOCK = np.array([[0.1, 0.05], [0.14, 0.05], [0.14, 0.2], [0.1, 0.2]])
SQUARE = shape_outline("rect1")
SCENE = Scene(SQUARE, TABLE, [BLOCK])


def overhang(**changes) -> Overhang:
    """At least 30 mm of the square over the edge at x = 0.3, so the centre is at most 15 mm behind it."""
    options = {"edge": 1, "least": 0.03, "heading": 0.0, "turn": 0.1, "along": (0.05, 0.15), "symmetry": 4}
    return Overhang(SCENE.body, SCENE.table, **{**options, **changes})


@pytest.mark.parametrize(("pose", "clearance"), [
    ((-0.2, 0.0, 0.0), 0.1),  # the centre is 0.1 from the edge; the outline may pass it
    ((-0.31, 0.0, 0.0), -0.01),
    ((0.05, 0.1, 0.0), 0.005),
    ((0.06, 0.1, np.pi / 2.0), -0.005),
    ((0.12, 0.0, 0.0), 0.005),
    ((0.12, 0.0, np.pi / 4.0), 0.05 - 0.045 * np.sqrt(2.0)),
])  # fmt: skip
def test_clearance_is_that_to_the_nearest_obstacle_or_edge(pose, clearance):
    assert SCENE.clearance(np.array(pose)) == pytest.approx(clearance)


@pytest.mark.parametrize("outline", [SQUARE, shape_outline("ellip2")], ids=["square", "ellipse"])
@pytest.mark.parametrize("margin", [0.0, 0.007])
def test_safe_poses_are_those_with_clearance(outline, margin):
    scene = Scene(outline, TABLE, [BLOCK, BLOCK - [0.3, 0.1]])
    poses = np.random.default_rng(1).uniform([-0.35, -0.25, -3.0], [0.35, 0.25, 3.0], (40, 50, 3))
    safe = scene.safe(poses, margin)
    assert 0.2 < safe.mean() < 0.8
    np.testing.assert_array_equal(safe, scene.clearance(poses) > margin)


def test_smooth_outline_is_within_a_quarter_millimetre():
    scene = Scene(shape_outline("ellip1"), TABLE, [BLOCK])
    assert scene.clearance(np.array([0.04, 0.1, 0.3])) == pytest.approx(0.06 - 0.0525, abs=2.6e-4)


def test_polygon_is_refused_with_its_field():
    with pytest.raises(RequestError, match=r"obstacles\[1\]: .*convex"):
        Scene(SQUARE, TABLE, [BLOCK, BLOCK[::-1]])
    with pytest.raises(RequestError, match=r"table: .*at least three"):
        Scene(SQUARE, TABLE[:2])


@pytest.mark.parametrize(("pose", "reached"), [
    ((0.29, -0.1, 0.0), True),
    ((0.286, -0.1, 0.0), True),
    ((0.284, -0.1, 0.0), False),  # 29 mm over the edge
    ((0.3001, -0.1, 0.0), False),  # falls
    ((0.29, -0.1, np.pi / 2.0 + 0.09), True),
    ((0.29, -0.1, 0.11), False),
    ((0.29, -0.149, 0.0), True),
    ((0.29, -0.151, 0.0), False),
    ((0.29, -0.051, 0.0), True),
    ((0.29, -0.049, 0.0), False),
])  # fmt: skip
def test_overhang_is_reached_within_its_bounds(pose, reached):
    assert overhang().reached(np.array(pose)) == reached


def test_remaining_distance_to_an_overhang():
    distance, turn = overhang().remaining(np.array([[0.2, -0.2, 0.3], [0.2925, -0.1, -np.pi / 2.0]]))
    np.testing.assert_allclose(distance, [np.hypot(0.0925, 0.05), 0.0], atol=1e-12)
    np.testing.assert_allclose(turn, [0.3, 0.0], atol=1e-12)


@pytest.mark.parametrize(("changes", "field"), [
    ({"edge": 4}, "edge"), ({"least": 0.05}, "least"), ({"least": 0.0}, "least"), ({"turn": 0.0}, "turn"),
    ({"along": (0.1, 0.1)}, "along"), ({"symmetry": 0}, "symmetry"),
])  # fmt: skip
def test_overhang_refuses_a_value_out_of_range(changes, field):
    with pytest.raises(RequestError) as error:
        overhang(**changes)
    assert error.value.field == field


def test_costs_without_obstacles_are_distances_and_turns():
    target = PoseTarget(Goal(np.array([0.1, 0.0, 0.2]), 0.01, 0.1))
    costs = cost_to_go(Scene(SQUARE, TABLE), target, longest=0.05, widest=0.5)
    assert costs.at(np.array([-0.1, 0.0, 0.2])) == pytest.approx(4.0, rel=0.03)
    assert costs.at(np.array([0.1, 0.0, 1.7])) == pytest.approx(3.0, rel=0.05)
    assert costs.at(np.array([0.1, 0.0, 0.2 - np.pi])) == pytest.approx(2.0 * np.pi, rel=0.05)


def test_costs_lead_around_an_obstacle():
    wall = np.array([[0.0, -0.15], [0.02, -0.15], [0.02, 0.2], [0.0, 0.2]])
    target = PoseTarget(Goal(np.array([0.1, 0.1, 0.0]), 0.01))
    table = TABLE - [0.0, 0.1]
    around = cost_to_go(Scene(SQUARE, 1.2 * table, [wall]), target, 0.05, 0.5)
    start, before_gap = np.array([-0.1, 0.1, 0.0]), np.array([0.01, -0.21, 0.0])
    assert around.at(start) > np.hypot(0.11, 0.31) / 0.05
    assert around.at(before_gap) < around.at(start) - 4.0


def test_costs_are_periodic_in_the_heading():
    """Of a square that any heading suits, by a quarter turn."""
    wall = np.array([[0.0, -0.11], [0.02, -0.11], [0.02, 0.2], [0.0, 0.2]])
    costs = cost_to_go(Scene(SQUARE, TABLE, [wall]), PoseTarget(Goal(np.array([0.1, 0.0, 0.0]), 0.01)), 0.05, 0.5)
    poses = np.random.default_rng(2).uniform([-0.05, -0.2, 0.0], [0.05, 0.0, 1.5], (50, 3))
    for turn in (-np.pi / 2.0, np.pi / 2.0, 2.0 * np.pi):
        np.testing.assert_allclose(costs.at(poses + [0.0, 0.0, turn]), costs.at(poses), atol=1e-9)
    assert np.ptp(costs.at(np.column_stack([np.zeros(10), np.full(10, -0.15), np.linspace(0.0, 1.5, 10)]))) > 0.1


# --- paths of the tip ---


PUSHER, WIDE = PusherGeometry(SQUARE, 0.00475, 0.1), np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
NOISE = np.diag([3e-4, 1e-4, 5e-3]) ** 2


def carried(inputs) -> Prediction:
    """A slider that goes where the tip goes, with more noise along the push; it knows only the first two sides."""
    noise = np.tile(NOISE, (len(inputs), 1, 1))
    mean = np.column_stack([PUSHER.window * inputs[:, 0], np.zeros((len(inputs), 2))])
    return Prediction(mean, noise, noise, inputs[:, 1] < 0.5)


def test_a_slider_follows_the_tip_and_its_uncertainty_grows_with_the_windows():
    tips, heading = np.array([[-0.045 - PUSHER.radius, 0.01]]), np.array([[0.5, 0.5]])
    paths = slider_paths(carried, PUSHER, np.zeros(3), tips, np.array([[0.05, 0.03]]), heading, (1, 2))
    along = np.array([np.cos(0.5), np.sin(0.5)])
    np.testing.assert_allclose(paths.poses[0], [[*(0.005 * along), 0.0], [*(0.011 * along), 0.0]], atol=1e-12)
    assert along @ paths.covariance[0, 1, :2, :2] @ along == pytest.approx(3.0 * 3e-4**2)
    assert paths.covariance[0, :, 2, 2] == pytest.approx([5e-3**2, 3.0 * 5e-3**2])
    assert paths.known.all()


def test_a_tip_that_leaves_the_slider_or_the_domain_leads_to_no_known_pose():
    tips = np.array([[-0.045 - PUSHER.radius, 0.0]] * 2 + [[0.045 + PUSHER.radius, 0.0]])
    headings = np.array([[0.0, 0.0, 0.0], [0.0, np.pi, 0.0], [np.pi, np.pi, np.pi]])
    paths = slider_paths(carried, PUSHER, np.zeros(3), tips, np.full((3, 3), 0.05), headings, (1, 1, 1))
    assert paths.known.tolist() == [[True] * 3, [True, False, False], [False] * 3]
    ahead = np.array([0.003, 0.0, 0.0])  # of the tip
    assert not slider_paths(carried, PUSHER, ahead, tips[:1], np.full((1, 1), 0.05), headings[:1, :1], (1,)).known.any()


def test_how_likely_a_goal_is_reached_is_the_mean_over_the_gaussian():
    rng, mean = np.random.default_rng(0), np.array([0.002, -0.001, 0.03])
    covariance = np.array([[4e-6, 1e-6, 1e-5], [1e-6, 2e-6, 0.0], [1e-5, 0.0, 4e-4]])
    drawn, tolerance = rng.multivariate_normal(mean, covariance, 200_000), np.array([0.002, 0.002, 0.05])
    for turn, size in ((0.05, 3), (None, 2)):
        closeness = np.exp(-np.sum((drawn / tolerance)[:, :size] ** 2, axis=1)).mean()
        assert Goal(np.zeros(3), 0.002, turn).likely(mean, covariance) == pytest.approx(closeness, rel=0.02)


def test_an_uncertain_heading_may_touch_an_obstacle_as_an_uncertain_place_may():
    wall = Scene(SQUARE, WIDE, [np.array([[0.05, -1.0], [1.0, -1.0], [1.0, 1.0], [0.05, 1.0]])])
    near = np.array([[0.0, 0.0, 0.0], [0.005, 0.0, 0.0], [0.01, 0.0, 0.0]])
    sideways, turned = np.diag([4e-6, 0.0, 0.0]), np.diag([0.0, 0.0, 4e-6 / SQUARE.reach**2])
    for covariance in (sideways, turned):
        touch = wall.touch_probability(near, np.tile(covariance, (3, 1, 1)))
        np.testing.assert_allclose(touch, [0.00621, 0.5, 0.99379], atol=1e-4)
