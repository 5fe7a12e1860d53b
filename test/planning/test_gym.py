# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The Gymnasium environment: its contract, its task, and that its outcomes are samples of the model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="rosdep has no key of gymnasium: pip install gymnasium")
import gymnasium
from drifting_models import extended, grain, pushes, slippery
from gymnasium.utils.env_checker import check_env
from synthetic import square_rig

from push_predictor.errors import ModelFileError, RequestError
from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.shapes import shape_outline
from push_predictor.gym import ID
from push_predictor.gym.task import push_task
from push_predictor.models.effects.traced_session import TracedSession
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.models.train import train_model
from push_predictor.planning.goal import Goal
from push_predictor.planning.persistence import persistence_of, root_of
from push_predictor.recordings.table import empty_table
from push_predictor.types import Array

SHIPPED = push_task().model
START = np.array([-0.12, 0.03, 0.4])
FORWARD = np.array([-0.8, 0.1, 0.5])  # an action: pushes at 0.4 of the first side
BLOCK = np.array([[0.0, -0.2], [0.05, -0.2], [0.05, 0.2], [0.0, 0.2]])
SHORT = np.array([[-0.15, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.15, 0.2]])
SMALL = Goal([0.0, 0.0, 0.0], distance=0.005)  # all of a tiny table
FAR = [0.2, 0.0, 0.0]


def one(**options: Any) -> Any:
    return gymnasium.make(ID, **{"model": SHIPPED, "start": START, **options})


def stepped(env: Any, action: Array = FORWARD) -> tuple[Any, ...]:
    """The first step of an episode."""
    env.reset(seed=0)
    return env.step(action)


def many(count: int, **options: Any) -> Any:
    return gymnasium.make_vec(ID, num_envs=count, **{"model": SHIPPED, **options})


def inputs_of(action: Array, model: TabulatedModel = SHIPPED) -> Array:
    """Inputs (1, 3) of an action (3,)."""
    (slow, fast), (least, most) = model.model.input_limits
    share = (action + 1.0) / 2.0
    return np.array([[slow + share[2] * (fast - slow), share[0] % 1.0, least + share[1] * (most - least)]])


def whitened(before: Array, after: Array, action: Array, model: TabulatedModel = SHIPPED) -> Array:
    """What a model did not predict of displacements in the world (n, 3), from one pose, in units of its covariance."""
    inputs = inputs_of(action, model)
    inward = model.model.rig.outline.inward_normal(inputs[:, 1])[0]
    heading = before[:, 2] + np.arctan2(inward[1], inward[0]) + inputs[0, 2]
    poses = {"push_heading": heading[:1], "slider_heading": before[:1, 2]}
    said = model.predict_rows(inputs, np.array([model.model.usual_duration]), poses)
    moved = np.column_stack([rotate((after - before)[:, :2], -heading), (after - before)[:, 2]])
    return (moved - said.mean) @ np.linalg.inv(root_of(said.covariance)[0]).T


def pushed(actions: list[Array], count: int, model: TabulatedModel = SHIPPED) -> list[Array]:
    """Whitened outcomes (count, 3) of these actions, one after the other, from one start."""
    env = many(count, model=model, start=START, goal=FAR)
    slider, found = env.reset(seed=5)[1]["slider"], []
    for action in actions:
        *_, info = env.step(np.tile(action, (count, 1)))
        found.append(whitened(slider, info["slider"], action, model))
        slider = info["slider"]
    return found


@pytest.mark.filterwarnings("error")
def test_the_checks_of_gymnasium_pass():
    env = gymnasium.make(ID)  # of the shipped model, about the origin
    check_env(env.unwrapped)


def test_sliders_of_the_vector_form_move_exactly_as_single_ones_with_their_seeds():
    """Also over the ends of episodes, which begin again at the next step."""
    options = {"model": SHIPPED, "max_episode_steps": 12, "obstacles": [BLOCK], "goal": FAR}
    together, apart = many(5, **options), gymnasium.make_vec(ID, num_envs=5, vectorization_mode="sync", **options)
    together.action_space.seed(0)
    np.testing.assert_array_equal(together.reset(seed=7)[0], apart.reset(seed=7)[0])
    terminated = truncated = 0
    for _ in range(60):
        action = together.action_space.sample()
        (*one_side, info), (*other, expected) = together.step(action), apart.step(action)
        for found, wanted in zip(one_side, other, strict=True):
            np.testing.assert_array_equal(found, wanted)
        np.testing.assert_array_equal(info["slider"], expected["slider"])
        terminated, truncated = terminated + one_side[2].sum(), truncated + one_side[3].sum()
    assert terminated and truncated


def test_a_seed_decides_what_happens_and_without_one_the_episodes_go_on_differently():
    def episode(env: Any, **seed: Any) -> Array:
        return np.array([env.reset(**seed)[0], *(env.step(FORWARD)[0] for _ in range(3))])

    env = one(start=None)
    first, second = episode(env, seed=3), episode(env)
    again, after = episode(env, seed=3), episode(env)
    np.testing.assert_array_equal([first, second], [again, after])
    assert np.abs(first - second).max() > 0.01 and np.abs(first - episode(env, seed=4)).max() > 0.01
    np.testing.assert_array_equal(many(2).reset(seed=[9, 3])[0][1], first[0])


def test_actions_span_the_domain_and_those_beyond_are_clipped():
    env = one()
    for action in (np.array([-0.5, -1.0, -1.0]), np.array([-0.5, 3.0, 2.0])):
        assert stepped(env, action)[4]["in_domain"] is True
        np.testing.assert_allclose(env.unwrapped._one._sliders.inputs, inputs_of(np.clip(action, -1.0, 1.0)))
    (first,), (last,) = (pushed([np.array([contact, 0.0, 0.0])], 2) for contact in (-1.0, 1.0))
    np.testing.assert_array_equal(first, last)  # once around the outline


def test_observed_is_the_goal_in_the_sliders_frame_and_reward_is_how_much_nearer_it_is_in_tolerances():
    env = one(goal=Goal([0.1, 0.1, 1.0], distance=0.02, turn=0.05))
    observation, before = env.reset(seed=0)
    ahead = to_body(np.array([0.1, 0.1]), START)
    np.testing.assert_allclose(observation, [*ahead, np.cos(0.6), np.sin(0.6)], rtol=1e-6)
    _, reward, terminated, truncated, after = env.step(FORWARD)
    errors = [np.abs(info["slider"] - info["goal"]) for info in (before, after)]
    nearer = [np.hypot(x, y) / 0.02 + turn / 0.05 for x, y, turn in errors]
    assert reward == pytest.approx(nearer[0] - nearer[1])
    assert not (terminated or truncated or after["is_success"])


@pytest.mark.parametrize(("away", "turned", "turn", "success"), [
    (0.0045, 0.09, 0.1, True), (0.0055, 0.0, 0.1, False), (0.0, 0.11, 0.1, False), (0.0, 3.0, None, True),
])  # fmt: skip
def test_success_is_within_5_mm_and_a_tenth_of_a_radian_unless_the_goal_has_tolerances(away, turned, turn, success):
    pose = stepped(one())[4]["slider"] + [away, 0.0, turned]
    _, reward, terminated, _, info = stepped(one(goal=pose if turn else Goal(pose, distance=0.005)))
    assert terminated is info["is_success"] is success
    assert (reward > 10.0) == success and not info["touches"] and not info["off_table"]


@pytest.mark.parametrize(("reason", "options", "action"), [
    ("touches", {"obstacles": [BLOCK]}, [-0.8, 0.0, 1.0]),  # to the right
    ("off_table", {"table": SHORT}, [0.25, 0.0, 1.0]),  # to the left
])  # fmt: skip
def test_touching_an_obstacle_and_leaving_the_table_end_an_episode(reason: str, options: Any, action: list[float]):
    env = one(goal=FAR, start=[-0.1, 0.0, 0.0], **options)
    env.reset(seed=0)
    steps = [env.step(np.array(action)) for _ in range(40)]
    first = next(k for k, step in enumerate(steps) if step[2])
    *_, info = steps[first]
    assert first > 1 and [name for name in ("is_success", "touches", "off_table") if info[name]] == [reason]


def test_success_is_no_touch_and_of_a_circle_any_heading():
    beside = push_task(SHIPPED, [-0.046, 0.0, 0.0], [BLOCK])
    pose = np.array([[-0.043, 0.0, 0.0]])
    assert beside.goal.reached(beside.goal.ahead(pose)) and beside.ends(pose)["touches"]
    assert not beside.ends(pose)["is_success"]
    rig = replace(square_rig(), outline=shape_outline("ellip1"))
    assert push_task(train_model(empty_table(), rig, "prior", name="round"), FAR).goal.turn is None


def test_an_episode_lasts_100_windows():
    env, one_side_then_the_other = many(1, goal=FAR, start=START), [[[0.9, 0.0, -1.0]], [[-0.1, 0.0, -1.0]]]
    _, first = env.reset(seed=0)
    steps = [env.step(np.array(one_side_then_the_other[k % 2])) for k in range(100)]
    assert not any(step[2] for step in steps) and [bool(step[3]) for step in steps] == [False] * 99 + [True]
    assert one().spec.max_episode_steps == 100
    assert not first["in_domain"]  # the info of a step is not that of a later one


def test_random_starts_are_spread_over_the_free_part_of_the_table():
    goal = Goal(FAR, distance=0.15)
    _, info = many(500, obstacles=[BLOCK], goal=goal).reset(seed=0)
    x, y, heading = info["slider"].T
    assert np.hypot(x - 0.2, y).min() > 0.15 and not ((x > -0.04) & (x < 0.09) & (np.abs(y) < 0.2)).any()
    for column, end in ((x, -0.25), (y, -0.25), (y, 0.25), (heading, np.pi), (heading, -np.pi)):
        assert np.abs(column - end).min() < 0.02 * abs(end)


def test_outcomes_have_the_models_mean_and_covariance_and_the_errors_of_a_push_last():
    """Bounds of 4.5 standard errors. A contact within a tip's radius goes on with the push, one beyond it does not."""
    count, rig = 20_000, SHIPPED.model.rig
    radius = 2.0 * rig.pusher_radius / rig.outline.perimeter  # in units of the action
    slow, other = FORWARD + [0.9 * radius, 0.0, -1.0], FORWARD + [1.1 * radius, 0.0, 0.0]
    z = pushed([FORWARD, slow, FORWARD, other], count)
    for found in z:
        np.testing.assert_allclose(found.mean(axis=0), 0.0, atol=4.5 / np.sqrt(count))
        np.testing.assert_allclose(np.cov(found.T), np.eye(3), atol=4.5 * np.sqrt(2.0 / count))
    around = pushed([np.array([end * (1.0 - 0.4 * radius), 0.0, 0.0]) for end in (-1.0, 1.0)], count)
    assert np.mean(around[0] * around[1], axis=0).min() > 0.15  # from the begin of the outline to its end
    one, two = (inputs_of(action)[0, 0] * SHIPPED.model.usual_duration for action in (FORWARD, slow))
    known = persistence_of(SHIPPED.model).correlation(np.array([one, two, one + two]))
    assert known[:2].min() > 0.15 and np.abs(known[0] - known[1]).min() > 0.1
    for (first, second), wanted in zip(((0, 1), (1, 2), (0, 2), (2, 3)), (*known, 0.0), strict=True):
        found = np.mean(z[first] * z[second], axis=0)
        np.testing.assert_allclose(found, wanted, atol=4.5 * np.sqrt(2.0 / count))


def test_a_slider_without_a_finite_prediction_stays(monkeypatch: pytest.MonkeyPatch):
    def unknown(*_: Any) -> tuple[Array, Array]:
        return np.full((1, 3), np.nan), np.ones(1, dtype=bool)

    monkeypatch.setattr("push_predictor.gym.pushed_sliders.sampled_displacements", unknown)
    _, reward, terminated, _, info = stepped(one(goal=FAR))
    assert reward == 0.0 and not terminated and not info["in_domain"]
    np.testing.assert_array_equal(info["slider"], START)


def drifting(**now: float) -> PushModel:
    """Friction that depends on the elapsed time, of which the trace may have left a default, and on the heading."""
    model = extended(train_model(pushes(40), square_rig(), "analytical", name="base"), slippery(0.3), grain(0.5))
    return replace(model, predictor=replace(model.predictor, session=TracedSession(now)))


def test_an_extended_model_predicts_with_its_defaults_and_the_poses():
    late, early = tabulate(drifting(elapsed_time=900.0)), tabulate(drifting(elapsed_time=0.0))
    z, other = (pushed([FORWARD], 4000, model)[0].mean(axis=0) for model in (late, early))
    np.testing.assert_allclose([z, other], 0.0, atol=4.5 / np.sqrt(4000))


@pytest.mark.parametrize(("options", "message"), [
    ({"goal": [0.3, 0.0, 0.0]}, r"^goal: \[0\.3, 0\.0, 0\.0\] is not accepted, give a pose on the table"),
    ({"goal": [0.0, 0.0]}, r"^goal pose: \[0\.0, 0\.0\] is not accepted, give three finite numbers"),
    ({"obstacles": [BLOCK[:2]]}, r"^obstacles\[0\]: .* at least three \[x, y\] in metres$"),
    ({"table": BLOCK[::-1]}, "^table: .* counter-clockwise$"),
    ({"table": 1e-2 * BLOCK - 1e-4, "goal": SMALL, "start": None}, "^table: .* room outside of the goal$"),
    ({"start": [0.0, 0.0, 0.0]}, r"^start: .* not at the goal, or None$"),
    ({"start": [0.0, np.nan, 0.0]}, r"^start: \[0\.0, nan, 0\.0\]"),
    ({"max_episode_steps": 0}, "^max_episode_steps: 0 is not accepted, give a number above 0$"),
])  # fmt: skip
def test_what_cannot_be_is_refused_with_its_name_and_value(options: dict[str, Any], message: str):
    with pytest.raises(RequestError, match=message):
        many(2, **{"start": START, **options}).reset(seed=0)


def test_other_refusals_name_what_is_wrong_too():
    with pytest.raises(ModelFileError, match="nowhere"):
        one(model="nowhere.pushmodel")
    with pytest.raises(RequestError, match=r"^model: 'base' .* it needs elapsed_time$"):
        one(model=drifting())
    env = many(2)
    with pytest.raises(RequestError, match=r"^seed: \[1, 2, 3\] is not accepted, give one number, or 2$"):
        env.reset(seed=[1, 2, 3])
    for action in (np.zeros((2, 2)), np.full((2, 3), np.nan)):
        with pytest.raises(RequestError, match=r"^action: .* contact, angle, velocity$"):
            env.step(action)


def test_the_picture_changes_with_the_slider():
    env = one(obstacles=[BLOCK], goal=FAR, render_mode="rgb_array")
    env.reset(seed=0)
    before = env.render()
    env.step(FORWARD)
    assert before.dtype == np.uint8 and before.shape[2] == 3 and np.abs(before.astype(int) - env.render()).max() > 100
