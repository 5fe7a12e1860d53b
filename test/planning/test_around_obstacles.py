# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sequences of pushes past obstacles and edges; which poses are safe, which are in a target; paths of the tip."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from push_predictor.errors import RequestError
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.prediction import Prediction
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.around_obstacles import plan_around_obstacles
from push_predictor.planning.obstacles.belief import after_displacement, certain, partial_displacement
from push_predictor.planning.obstacles.cost_to_go import cost_to_go
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import Overhang, PoseTarget
from push_predictor.planning.repertoire import Repertoire, StraightPushes
from push_predictor.planning.tip_paths import slider_paths
from push_predictor.planning.unscented import PusherGeometry

SQUARE = shape_outline("rect1")
START = np.array([-0.1, 0.0, 0.0])


def box(x_from, x_to, y_from, y_to):
    return np.array([[x_from, y_from], [x_to, y_from], [x_to, y_to], [x_from, y_to]])


TABLE = box(-0.3, 0.3, -0.2, 0.2)


def made_up(means, sds) -> Repertoire:
    """Pushes with contacts 0, 0.001, ... as labels; sds (3,) or (n, 3)."""
    means = np.array(means, dtype=np.float64)
    inputs = np.column_stack([np.full(len(means), 0.02), 0.001 * np.arange(len(means)), np.zeros(len(means))])
    covariance = np.broadcast_to(sds, means.shape)[:, :, None] ** 2 * np.eye(3)
    return Repertoire(StraightPushes(inputs, np.ones(len(means), dtype=np.int64)), means, covariance)


def compass(sd: float) -> Repertoire:
    """Pushes of 10 and 50 mm in 24 directions, without a turn; sd in m of the long ones."""
    headings = np.pi / 12.0 * np.arange(24)
    along = np.column_stack([np.cos(headings), np.sin(headings), np.zeros(24)])
    sds = np.repeat([[0.2 * sd, 0.2 * sd, 0.0], [sd, sd, 0.0]], 24, axis=0)
    of = made_up(np.vstack([0.01 * along, 0.05 * along]), sds)
    return replace(of, pushes=StraightPushes(of.pushes.inputs, np.repeat([1, 5], 24)))


def region(x, y, radius=0.012) -> PoseTarget:
    return PoseTarget(Goal(np.array([x, y, 0.0]), radius))


def labels(plan):
    return np.rint(1000.0 * plan.pushes.inputs[:, 1]).astype(int).tolist()


def test_straight_way_takes_the_fewest_pushes():
    plan = plan_around_obstacles(compass(0.001), Scene(SQUARE, TABLE), START, region(0.1, 0.0))
    assert labels(plan) == [24] * 4 and plan.probability > 0.99 and plan.risk[-1] == 0.0
    np.testing.assert_allclose(plan.poses[:, 0], [-0.1, -0.05, 0.0, 0.05, 0.1], atol=1e-12)
    assert plan.samples[-1].std(axis=0)[:2] == pytest.approx([0.002, 0.002], rel=0.15)


def test_plan_prints_each_push_with_where_it_leads_and_its_risk():
    plan = plan_around_obstacles(compass(0.001), Scene(SQUARE, TABLE), START, region(-0.04, 0.0))
    head, push, *more = str(plan).splitlines()
    assert re.fullmatch(r"Plan: \d pushes, which end in the target with probability [01]\.\d\d", head)
    contact = (
        f"contact {plan.pushes.inputs[0, 1]:.3f}, angle +0.00 rad, 20.0 mm/s, for {plan.pushes.windows[0]} windows"
    )
    x, y, heading = plan.poses[1]
    assert push.startswith(f"  1: {contact}; then slider at x {x:.4f} m, y {y:.4f} m, heading {heading:.3f} rad; risk ")
    assert push.endswith(f" {plan.risk[0]:.3f}") and len(more) == len(plan.pushes) - 1


def test_plan_leads_around_an_obstacle():
    scene = Scene(SQUARE, TABLE, [box(-0.01, 0.01, -0.03, 0.2)])
    plan = plan_around_obstacles(compass(0.0005), scene, START, region(0.1, 0.0))
    assert plan.poses[:, 1].min() < -0.07 and plan.risk[-1] <= 0.05 and plan.probability > 0.9


def test_risk_is_the_probability_to_fall():
    """One push towards the edge at x = 0.3, after which the centre is normal with mean 0.28 and sd 0.015."""
    target = region(0.28, 0.0, 0.1)
    near = np.array([0.23, 0.0, 0.0])
    plan = plan_around_obstacles(
        made_up([[0.05, 0.0, 0.0]], [0.015, 0.0, 0.0]), Scene(SQUARE, TABLE), near, target, 0.2, most_pushes=1
    )
    assert plan.risk[0] == pytest.approx(norm.cdf(-0.02 / 0.015), abs=0.03)
    assert plan.probability == pytest.approx(1.0 - plan.risk[0])


def test_noise_adds_up_unless_the_slider_is_observed():
    scene, one = Scene(SQUARE, TABLE), made_up([[0.05, 0.0, 0.0]], [0.0, 0.004, 0.0])
    unseen = plan_around_obstacles(one, scene, START, region(0.1, 0.0, 0.005), 0.5)
    observed = plan_around_obstacles(one, scene, START, region(0.1, 0.0, 0.005), 0.5, observed=True)
    assert unseen.probability == pytest.approx(1.0 - 2.0 * norm.cdf(-0.005 / 0.008), abs=0.05)
    assert observed.probability == pytest.approx(1.0 - 2.0 * norm.cdf(-0.005 / 0.004), abs=0.05)


def test_risks_of_observed_pushes_combine():
    """Two pushes along a wall, each of which touches it with probability 0.16."""
    scene = Scene(SQUARE, TABLE, [box(-0.2, 0.2, 0.05, 0.2)])
    one = made_up([[0.05, 0.0, 0.0]], [0.0, 0.005, 0.0])
    plan = plan_around_obstacles(one, scene, START, region(0.0, 0.0, 0.02), 0.5, observed=True)
    assert plan.risk == pytest.approx([0.16, 1.0 - 0.84**2], abs=0.04)


def test_sure_push_is_chosen_near_an_obstacle_and_the_bound_is_kept():
    scene = Scene(SQUARE, TABLE, [box(-0.2, 0.2, 0.05, 0.2)])
    pushes = made_up([[0.05, 0.0, 0.0], [0.05, -0.0004, 0.0]], [[0.0, 0.005, 0.0], [0.0, 0.001, 0.0]])
    assert labels(plan_around_obstacles(pushes, scene, START, region(-0.05, 0.0), 0.1)) == [1]
    noisy = made_up([[0.05, 0.0, 0.0]], [0.0, 0.005, 0.0])
    assert plan_around_obstacles(noisy, scene, START, region(-0.05, 0.0), 0.1) is None
    assert plan_around_obstacles(noisy, scene, START, region(-0.05, 0.0), 0.3).risk[0] < 0.3


def test_bound_is_kept_with_new_samples():
    scene = Scene(SQUARE, TABLE, [box(-0.2, 0.2, 0.05, 0.2)])
    plans = []
    for sd in np.linspace(0.0028, 0.0038, 21):
        pushes = made_up([[0.05, 0.0, 0.0]], [0.0, sd, 0.0])
        plans.append(plan_around_obstacles(pushes, scene, START, region(-0.05, 0.0), 0.063, most_pushes=1))
    assert plans[0] is not None and plans[-1] is None
    assert all(plan.risk[-1] <= 0.063 for plan in plans if plan is not None)


def test_risky_sequences_do_not_crowd_out_a_safe_one():
    """Nine quick pushes that touch with probability 0.07; seven slow ones are safe and score less."""
    scene = Scene(SQUARE, TABLE, [box(-0.2, 0.2, 0.05, 0.2)])
    quick = [[0.026 + 0.004 * k, 0.0, 0.0] for k in range(9)]
    pushes = made_up([*quick, [0.0025, 0.0, 0.0]], [*[[0.0, 0.0034, 0.0]] * 9, [0.0, 0.0, 0.0]])
    plan = plan_around_obstacles(pushes, scene, START, region(-0.058, 0.0, 0.025), 0.03)
    assert labels(plan) == [9] * 7


def test_pushes_of_a_sequence_are_independent():
    """Two pushes: the sd of the end is that of one times the root of 2, not times 2, already in the search."""
    sd, bound = 0.004, 0.035
    scene = Scene(SQUARE, TABLE, [box(-0.3, 0.3, 0.045 + 2.3 * np.sqrt(2.0) * sd, 0.2)])
    one = made_up([[0.05, 0.0, 0.0]], [0.0, sd, 0.0])
    plan = plan_around_obstacles(one, scene, START, region(0.0, 0.0, 0.04), bound)
    assert len(plan.pushes) == 2 and plan.risk[-1] < bound < norm.cdf(-2.3 / np.sqrt(2.0))


def test_push_without_a_gain_is_not_added():
    pushes = made_up([[0.05, 0.0, 0.0], [0.0001, 0.0, 0.0]], [[0.0, 0.015, 0.0], [0.0, 0.0, 0.0]])
    plan = plan_around_obstacles(pushes, Scene(SQUARE, TABLE), START, region(-0.05, 0.0, 0.01), most_pushes=12)
    assert labels(plan) == [0] and plan.probability < 0.6


def test_of_two_sure_pushes_the_one_that_ends_nearest_to_the_middle_is_taken():
    """Near is relative to the longest push and to the widest turn."""
    pushes = made_up([[0.05, 0.004, 0.0], [0.05, 0.0, 0.05], [0.05, 0.0, 0.1]], [0.0, 0.0, 0.0])
    target = PoseTarget(Goal(np.array([0.05, 0.0, 0.0]), 0.01, 0.08))
    assert labels(plan_around_obstacles(pushes, Scene(SQUARE, TABLE), np.zeros(3), target)) == [0]


def test_slider_that_has_touched_stays_failed():
    scene = Scene(SQUARE, TABLE, [box(0.0, 0.02, -0.2, 0.2)])
    through, onward = np.array([0.2, 0.0, 0.0]), np.array([0.02, 0.0, 0.0])
    belief = certain(START, 2)
    for moved in (through, onward):
        belief = belief.pushed(np.array([0]), moved[None], np.tile(moved, (1, 2, 1)), scene, 0.0)
    np.testing.assert_allclose(belief.mean[0], [0.12, 0.0, 0.0])
    assert belief.risk[0] == 1.0


def test_motion_between_start_and_end_counts():
    """The slider jumps over a thin wall at its ends, but not on the way."""
    scene = Scene(SQUARE, TABLE, [box(0.0, 0.005, -0.2, 0.2)])
    one = made_up([[0.12, 0.0, 0.0]], [0.0, 0.0, 0.0])
    assert plan_around_obstacles(one, scene, np.array([-0.06, 0.0, 0.0]), region(0.06, 0.0)) is None


def test_margin_keeps_the_slider_away_but_not_farther_than_it_is():
    scene = Scene(SQUARE, TABLE, [box(-0.2, 0.2, 0.05, 0.2)])
    straight = made_up([[0.05, 0.001, 0.0]], [0.0, 0.0, 0.0])
    away = made_up([[0.05, 0.0, 0.0]], [0.0, 0.0, 0.0])
    target = region(-0.05, 0.0)
    assert plan_around_obstacles(straight, scene, START, target, margin=0.0035) is not None
    assert plan_around_obstacles(straight, scene, START, target, margin=0.0045) is None
    assert plan_around_obstacles(away, scene, START, target, margin=0.02) is not None


def test_slider_is_brought_over_the_edge():
    scene = Scene(SQUARE, TABLE, [box(0.2, 0.3, 0.07, 0.2), box(0.2, 0.3, -0.2, -0.07)])
    target = Overhang(scene.body, scene.table, 1, 0.035, 0.0, 0.1, (0.15, 0.25), 4)
    plan = plan_around_obstacles(compass(0.0008), scene, START + [0.2, 0.0, 0.0], target)
    assert plan.probability > 0.9 and 0.29 < plan.poses[-1, 0] < 0.3


def test_part_of_a_displacement_lies_on_the_arc():
    whole = np.array([[0.1, 0.1, np.pi / 2.0], [0.1, 0.02, 0.0]])
    half = partial_displacement(whole, np.array([0.5, 0.5]))
    circle = [0.1 * np.sin(np.pi / 4.0), 0.1 * (1.0 - np.cos(np.pi / 4.0)), np.pi / 4.0]
    np.testing.assert_allclose(half, [circle, [0.05, 0.01, 0.0]], atol=1e-9)
    np.testing.assert_allclose(after_displacement(half[0], half[0]), whole[0], atol=1e-12)
    np.testing.assert_allclose(partial_displacement(whole, np.ones(2)), whole, atol=1e-12)


@pytest.mark.parametrize(("changes", "field"), [
    ({"risk": 0.0}, "risk"), ({"risk": 1.0}, "risk"), ({"margin": -0.001}, "margin"),
    ({"most_pushes": 0}, "most_pushes"),
    ({"slider": np.array([0.0, np.nan, 0.0])}, "slider"), ({"slider": np.zeros(2)}, "slider"),
    ({"slider": np.array([0.31, 0.0, 0.0])}, "slider"),
])  # fmt: skip
def test_value_out_of_range_is_refused(changes, field):
    with pytest.raises(RequestError) as error:
        plan_around_obstacles(
            compass(0.001), Scene(SQUARE, TABLE), target=region(0.1, 0.0), **{"slider": START, **changes}
        )
    assert error.value.field == field


# --- safe poses, targets and paths of the tip ---


BLOCK = np.array([[0.1, 0.05], [0.14, 0.05], [0.14, 0.2], [0.1, 0.2]])
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
