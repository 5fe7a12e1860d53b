# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Choice of pushes from synthetic repertoires and predictors whose best push is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drifting_models import extended, slippery
from drifting_models import pushes as drifting_pushes
from scipy.stats import norm
from synthetic import square_rig

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.prediction import Prediction
from push_predictor.models.train import train_model
from push_predictor.planning.choose import choose_push
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import model_repertoire
from push_predictor.planning.repertoire import Repertoire, StraightPushes, push_grid, repertoire
from push_predictor.planning.unscented import PusherGeometry

SQUARE = PusherGeometry(shape_outline("rect1"), 0.00475, 0.2)
AT_ORIGIN = np.zeros(3)


def made_up(means, sds) -> Repertoire:
    """Pushes with contacts 0, 0.01, ... as labels; sds (n, 3) or (n,)."""
    means, sds = np.array(means, dtype=np.float64), np.array(sds, dtype=np.float64)
    sds = sds if sds.ndim == 2 else np.tile(sds[:, None], 3)
    inputs = np.column_stack([np.full(len(means), 0.02), 0.01 * np.arange(len(means)), np.zeros(len(means))])
    covariance = np.einsum("ni,ij->nij", sds**2, np.eye(3))
    return Repertoire(StraightPushes(inputs, np.ones(len(means), dtype=np.int64)), means, covariance)


def number(choice) -> int:
    return round(100.0 * choice.push.inputs[0, 1])


def moving(sd: float, domain=lambda inputs: np.ones(len(inputs), dtype=bool), asked=None):
    """A predictor: the slider moves with the tip and does not turn; dy and dtheta scatter."""

    def predict(inputs) -> Prediction:
        if asked is not None:
            asked.append(inputs)
        mean = np.column_stack([0.2 * inputs[:, 0], np.zeros((len(inputs), 2))])
        covariance = np.tile(np.diag([0.0, sd**2, 0.0]), (len(inputs), 1, 1))
        return Prediction(mean, covariance, covariance, domain(inputs))

    return predict


# --- the next push -------------------------------------------------------------------------------------------------


def test_predictable_push_wins_over_a_better_aimed_noisy_push():
    goal = Goal(np.array([0.010, 0.0, 0.0]), 0.002, 0.05)
    pushes = made_up([[0.010, 0.0, 0.0], [0.011, 0.0, 0.01]], [0.002, 0.0002])
    choice = choose_push(pushes, AT_ORIGIN, goal, 0.9)
    assert number(choice) == 1 and choice.probability > 0.99


def test_no_push_is_chosen_at_the_goal():
    pushes = made_up([[0.01, 0.0, 0.0]], [0.0])
    assert choose_push(pushes, np.array([0.0011, 0.0, 0.09]), Goal(np.zeros(3), 0.0012, 0.1)) is None
    assert choose_push(pushes, np.array([0.0013, 0.0, 0.09]), Goal(np.zeros(3), 0.0012, 0.1)) is not None
    assert choose_push(pushes, np.array([0.0011, 0.0, 0.11]), Goal(np.zeros(3), 0.0012, 0.1)) is not None


def test_probability_equals_that_of_the_gaussian():
    sd, turn_sd, distance, turn = 0.001, 0.02, 0.0015, 0.03
    pushes = made_up([[0.01, 0.002, 0.1]], [[sd, sd, turn_sd]])
    choice = choose_push(pushes, AT_ORIGIN, Goal(np.array([0.01, 0.002, 0.1]), distance, turn))
    within = (1.0 - np.exp(-0.5 * (distance / sd) ** 2)) * (2.0 * norm.cdf(turn / turn_sd) - 1.0)
    assert choice.probability == pytest.approx(within, abs=0.015)
    anyhow = choose_push(pushes, AT_ORIGIN, Goal(np.array([0.01, 0.002, 2.0]), distance, None))
    assert anyhow.probability == pytest.approx(1.0 - np.exp(-0.5 * (distance / sd) ** 2), abs=0.015)


def test_probability_accounts_for_correlated_noise():
    """Of two pushes with the same variances the one that scatters on the goal's diagonal stays within it."""
    pushes = made_up([[0.01, 0.0, 0.0], [0.01, 0.0, 0.0]], [0.0015, 0.0015])
    covariance = pushes.covariance.copy()
    covariance[1, 0, 1] = covariance[1, 1, 0] = 0.99 * 0.0015**2
    goal = Goal(np.array([0.01, 0.0, 0.0]), 0.001, 0.05)
    aligned = choose_push(replace(pushes, covariance=covariance), AT_ORIGIN, goal, 0.3)
    along = 2.0 * norm.cdf(0.001 / (0.0015 * np.sqrt(1.99))) - 1.0
    assert number(aligned) == 1 and aligned.probability == pytest.approx(along, abs=0.03)


def test_push_is_chosen_with_one_step_lookahead():
    """Push 0 comes nearest, but what it leaves no push can mend; 1 and 2 after each other reach the goal."""
    pushes = made_up([[0.010, 0.0, 0.0], [0.006, 0.0, 0.0], [0.005, 0.0, 0.0]], [0.0, 0.0, 0.0])
    choice = choose_push(pushes, AT_ORIGIN, Goal(np.array([0.011, 0.0, 0.0]), 0.0004, 0.05))
    assert number(choice) in (1, 2) and choice.expected == pytest.approx(2.0)


def test_longest_push_is_chosen_far_from_the_goal():
    pushes = made_up([[0.01, 0.0, 0.0], [0.02, 0.0, 0.0], [-0.02, 0.0, 0.0]], [0.0, 0.0, 0.0])
    choice = choose_push(pushes, AT_ORIGIN, Goal(np.array([0.1, 0.0, 0.0]), 0.002, 0.05))
    assert number(choice) == 1 and choice.probability == 0.0
    assert choice.expected == pytest.approx(1.0 + 2.0 + 0.08 / 0.02)


def test_reported_probability_can_be_below_the_requested_one():
    """The likelier push reaches with 0.4 only; that of the pair that is sure is taken if 0.9 is asked for."""
    pushes = made_up([[0.010, 0.0, 0.0], [0.006, 0.0, 0.0], [0.004, 0.0, 0.0]], [0.001, 0.0, 0.0])
    goal = Goal(np.array([0.010, 0.0, 0.0]), 0.001, 0.05)
    assert number(choose_push(pushes, AT_ORIGIN, goal, 0.3)) == 0
    alone = made_up([[0.010, 0.0, 0.0]], [[0.004, 0.004, 0.0]])
    assert choose_push(alone, AT_ORIGIN, goal, 0.9).probability < 0.1


@pytest.mark.parametrize("probability", [0.3, 0.9])
def test_choice_is_equivariant_under_rotation_and_translation(probability):
    rng = np.random.default_rng(1)
    pushes = made_up(rng.normal(size=(300, 3)) * [0.01, 0.01, 0.1], rng.uniform(0.0002, 0.002, 300))
    slider, goal = np.array([0.01, -0.02, 0.3]), np.array([0.022, -0.013, 0.25])
    shift, turn = np.array([0.4, -1.2]), 2.5

    def carried(pose):
        return np.append(rotate(pose[:2], turn) + shift, pose[2] + turn)

    here = choose_push(pushes, slider, Goal(goal, 0.001, 0.05), probability)
    there = choose_push(pushes, carried(slider), Goal(carried(goal), 0.001, 0.05), probability)
    np.testing.assert_array_equal(there.push.inputs, here.push.inputs)
    assert there.probability == here.probability and there.expected == pytest.approx(here.expected)
    np.testing.assert_allclose(there.mean, carried(here.mean), atol=1e-12)
    along = rotate(np.eye(2), np.array(turn)).T
    np.testing.assert_allclose(there.covariance[:2, :2], along @ here.covariance[:2, :2] @ along.T, atol=1e-15)


def test_symmetric_goal_accepts_the_nearest_equivalent_heading():
    pushes = made_up([[0.01, 0.0, 0.1]], [0.0001])
    pose = np.array([0.01, 0.0, 0.1 + np.pi / 2.0])
    assert choose_push(pushes, AT_ORIGIN, Goal(pose, 0.001, 0.02, symmetry=4)).probability == 1.0
    assert choose_push(pushes, AT_ORIGIN, Goal(pose, 0.001, 0.02)).probability == 0.0


def test_rotation_to_the_goal_is_the_shortest():
    goal = Goal(np.array([0.0, 0.0, -3.1]), 0.001, 0.05)
    np.testing.assert_allclose(goal.ahead(np.array([0.0, 0.0, 3.1])), [0.0, 0.0, 2.0 * np.pi - 6.2], atol=1e-12)
    assert goal.reached(goal.ahead(np.array([0.0, 0.0, 3.16])))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"pose": np.array([0.0, np.nan, 0.0])}, "goal pose"),
        ({"distance": 0.0}, "goal distance"),
        ({"turn": -0.1}, "goal turn"),
        ({"symmetry": 0}, "goal symmetry"),
    ],
)
def test_rejects_an_invalid_goal_by_field(change, field):
    with pytest.raises(RequestError, match=field):
        Goal(**{"pose": np.zeros(3), "distance": 0.001, "turn": 0.1, **change})


def test_rejects_an_invalid_request_by_field():
    pushes, goal = made_up([[0.01, 0.0, 0.0]], [0.0]), Goal(np.ones(3), 0.001, 0.1)
    for probability in (0.0, 1.0, np.nan):
        with pytest.raises(RequestError, match="probability"):
            choose_push(pushes, AT_ORIGIN, goal, probability)
    with pytest.raises(RequestError, match="slider"):
        choose_push(pushes, np.array([0.0, np.inf, 0.0]), goal)


# --- what pushes do ------------------------------------------------------------------------------------------------


def test_outcome_of_several_windows_is_their_sum_without_noise():
    """The middle of edge 0, whose inward normal is +x: four windows go four times as far."""
    does = repertoire(moving(1e-4), SQUARE, np.array([[0.02, 0.125, 0.0]]), (1, 4))
    np.testing.assert_array_equal(does.pushes.windows, [1, 4])
    np.testing.assert_allclose(does.mean, [[0.004, 0.0, 0.0], [0.016, 0.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize(("persistent_fraction", "power"), [(0.0, 1), (1.0, 2)])
def test_noise_accumulates_with_the_persistent_fraction(persistent_fraction, power):
    does = repertoire(moving(1e-4), SQUARE, np.array([[0.02, 0.125, 0.0]]), (1, 4), persistent_fraction)
    np.testing.assert_allclose(does.covariance[:, 1, 1], [1e-8, 4.0**power * 1e-8], rtol=1e-6)


@pytest.mark.parametrize(("angle", "ahead"), [(0.0, 1e-6), (0.6, 1e-8)])
def test_contact_with_the_tip_removes_noise_along_the_normal(angle, ahead):
    def predict(inputs):
        answer = moving(0.0)(inputs)
        return replace(answer, covariance=np.tile(np.diag([ahead, 1e-8, 0.0]), (len(inputs), 1, 1)))

    does = repertoire(predict, SQUARE, np.array([[0.02, 0.125, angle]]), (3,))
    assert does.covariance[0, 0, 0] < 1e-15
    np.testing.assert_allclose(does.covariance[0, 1, 1], 3e-8, rtol=1e-6)


def test_pushes_outside_the_domain_are_dropped():
    """Only they would reach the goal at once."""
    known = moving(1e-5, lambda inputs: np.abs(inputs[:, 2]) < 0.5)
    lines = push_grid([0.02], np.array([0.125]), np.array([-0.2, 0.2, 0.7]))
    does = repertoire(known, SQUARE, lines, (1, 2, 3))
    assert len(does) == 6 and np.abs(does.pushes.inputs[:, 2]).max() < 0.5
    goal = Goal(0.004 * np.array([np.cos(0.7), np.sin(0.7), 0.0]), 0.0002, 0.05)
    assert abs(choose_push(does, AT_ORIGIN, goal).push.inputs[0, 2]) < 0.5


def test_push_that_leaves_the_domain_later_is_kept_with_fewer_windows():
    """Driving across the edge the tip comes to contacts above 0.13, which the model does not know."""
    across = np.array([[0.02, 0.12, -0.9]])
    known = moving(1e-6, lambda inputs: inputs[:, 1] < 0.13)

    def sliding(inputs):
        answer = known(inputs)
        ahead = 0.2 * inputs[:, 0] * np.cos(inputs[:, 2])  # only along the normal
        shift = np.column_stack([ahead * np.cos(inputs[:, 2]), -ahead * np.sin(inputs[:, 2]), 0.0 * ahead])
        return replace(answer, mean=shift)

    lengths = repertoire(sliding, SQUARE, across, (1, 2, 3, 4)).pushes.windows
    assert 1 in lengths and 4 not in lengths


def test_model_is_called_with_pushing_angles_only():
    asked: list[np.ndarray] = []
    predict = moving(2e-3, asked=asked)
    repertoire(predict, SQUARE, push_grid([0.02], np.linspace(0.0, 0.99, 40), np.linspace(-1.4, 1.4, 9)), (1, 2, 5))
    assert max(np.abs(inputs[:, 2]).max() for inputs in asked) < np.pi / 2.0


def test_empty_repertoire_is_an_error():
    nowhere = moving(0.0, lambda inputs: np.zeros(len(inputs), dtype=bool))
    with pytest.raises(RequestError, match="domain"):
        repertoire(nowhere, SQUARE, np.array([[0.02, 0.125, 0.0]]), (1, 2))


def test_push_ends_when_the_tip_passes_the_slider():
    """It drives along the edge and past the corner, 18 mm away; the slider gives way no further than it has to."""

    def still(inputs):
        return replace(moving(0.0)(inputs), mean=np.zeros((len(inputs), 3)))

    along = np.array([[0.02, 0.2, -1.4]])
    lengths = repertoire(still, SQUARE, along, range(1, 11)).pushes.windows
    assert 4 <= lengths.max() <= 6


def test_a_model_that_needs_covariates_is_refused_by_their_names():
    base = train_model(drifting_pushes(20), square_rig(), "analytical", name="drifting")
    with pytest.raises(RequestError, match=r"model: 'drifting' is not accepted, give .* elapsed_time"):
        model_repertoire(extended(base, slippery(0.1)))
