# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sequences of pushes past obstacles and edges, from repertoires whose best sequence is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from push_predictor.errors import RequestError
from push_predictor.geometry.shapes import shape_outline
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.around_obstacles import plan_around_obstacles
from push_predictor.planning.obstacles.belief import after_displacement, certain, partial_displacement
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import Overhang, PoseTarget
from push_predictor.planning.repertoire import Repertoire, StraightPushes

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


def test_plan_leads_around_an_obstacle():
    scene = Scene(SQUARE, TABLE, [box(-0.01, 0.01, -0.03, 0.2)])
    plan = plan_around_obstacles(compass(0.0005), scene, START, region(0.1, 0.0))
    assert plan.poses[:, 1].min() < -0.07 and plan.risk[-1] <= 0.05 and plan.probability > 0.9


def test_gate_narrower_than_the_slider_gives_no_plan():
    def gate(width):
        walls = [box(0.0, 0.02, -0.2, -0.5 * width), box(0.0, 0.02, 0.5 * width, 0.2)]
        return plan_around_obstacles(compass(0.0), Scene(SQUARE, TABLE, walls), START, region(0.1, 0.0))

    assert gate(0.089) is None
    assert gate(0.091).probability == 1.0


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
