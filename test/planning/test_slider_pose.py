# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Prediction of the slider's pose in the world: contact, symmetries, covariance, rejected requests."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from repository import BAGS
from synthetic import triangle

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.shapes import shape_outline
from push_predictor.geometry.touch import covariance_in_world, displaced
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.slider_pose import MAX_DEPTH, MAX_GAP, SliderAfter, WorldPush, slider_after
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.cut import pusher_motion
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.recordings.windows.track import Track

RADIUS, SPEED, DURATION = 0.00475, 0.02, 0.2
TOLD = ("slider_x", "slider_y", "slider_heading", "push_heading", "contact_gap")
METRES, ANGLES = st.floats(-2.0, 2.0), st.floats(-3.0, 3.0)
OUTLINES = {name: shape_outline(name) for name in ("rect1", "hex", "ellip2", "ellip1")} | {"triangle": triangle()}


@cache
def model_of(shape: str, kind: str = "analytical") -> PushModel:
    """A model whose outcomes scatter with one noise on all three, so that they are correlated."""
    rng = np.random.default_rng(0)
    rig = Rig(shape, OUTLINES[shape], RADIUS, "abs", 0.837)
    inputs = np.column_stack([np.full(60, SPEED), rng.random(60), rng.uniform(-1.0, 1.0, 60)])
    duration = np.full(60, DURATION)
    shared = rng.standard_normal((60, 1)) + 0.3 * rng.standard_normal((60, 3))
    outcomes = analytical_mechanics(rig.outline, RADIUS).displacement(inputs, duration) + shared * [1e-4, 2e-4, 5e-3]
    table = PushTable(
        inputs, duration, outcomes, np.array([f"p{k // 3}" for k in range(60)]), {"slider_x": rng.random(60)}
    )
    return train_model(table, rig, kind, name=f"{shape}_{kind}", options=TrainingOptions(mean="zero"))


def push_at(
    shape: str, contact: float, angle: float, gap: float = 0.0, pose: tuple[float, float, float] = (0.3, -0.2, 0.7)
) -> WorldPush:
    """The push (SPEED, contact, angle) of a slider at a pose, in world coordinates; gap between tip and outline, m."""
    outline, slider, at = OUTLINES[shape], np.array(pose), np.array([contact])
    inward = outline.inward_normal(at)[0]
    tip = to_world(outline.point(at)[0] - (RADIUS + gap) * inward, slider)
    velocity = SPEED * rotate(inward, np.array(angle + slider[2]))
    return WorldPush(slider, tip, velocity, DURATION)


def moved(push: WorldPush, shift: tuple[float, float], turn: float) -> WorldPush:
    """The same push in a world that is turned by `turn` and shifted."""
    frame = np.array([*shift, turn])
    slider = np.array([*to_world(push.slider[:2], frame), push.slider[2] + turn])
    return replace(
        push, slider=slider, pusher=to_world(push.pusher, frame), velocity=rotate(push.velocity, np.array(turn))
    )


def refusal(push: WorldPush, predictor: PushModel | None = None) -> str:
    with pytest.raises(RequestError) as caught:
        slider_after(predictor or model_of("rect1"), push)
    return str(caught.value)


# --- the outcome ------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("shape", OUTLINES)
@pytest.mark.parametrize("angle", [-1.2, 0.4])
def test_prediction_equals_that_of_the_model_at_the_contact(shape: str, angle: float) -> None:
    model, contacts = model_of(shape), np.arange(12) / 12.0 + 0.02  # every edge of every outline
    inputs = np.column_stack([np.full(12, SPEED), contacts, np.full(12, angle)])
    expected = model.predict_rows(inputs, np.full(12, DURATION))
    for k, (contact, (x, y, turn), in_domain) in enumerate(
        zip(contacts, expected.mean, expected.in_domain, strict=True)
    ):
        push = push_at(shape, contact, angle)
        heading = np.arctan2(push.velocity[1], push.velocity[0])
        by_hand = push.slider + [
            x * np.cos(heading) - y * np.sin(heading),
            x * np.sin(heading) + y * np.cos(heading),
            turn,
        ]
        after = slider_after(model, push)
        np.testing.assert_allclose(after.pose, by_hand, atol=1e-9)
        axes = np.eye(3)
        axes[:2, :2] = rotate(np.eye(2), heading)  # along and across the push, in the world
        np.testing.assert_allclose(after.covariance, axes.T @ expected.covariance[k] @ axes, rtol=1e-6, atol=1e-16)
        assert after.in_domain == bool(in_domain)


@given(st.sampled_from(sorted(OUTLINES)), st.floats(0.0, 0.999), st.floats(-1.3, 1.3), METRES, METRES, ANGLES)
def test_prediction_is_equivariant_under_rotation_and_translation(
    shape: str, contact: float, angle: float, x: float, y: float, turn: float
) -> None:
    edge, fraction = OUTLINES[shape].edge(np.array([contact]))
    if not 1e-6 < fraction[0] < 1.0 - 1e-6:
        contact = float(OUTLINES[shape].contact_on_edge(edge, 0.5)[0])  # which edge a corner belongs to: see below
    model, push = model_of(shape), push_at(shape, contact, angle)
    here, there = slider_after(model, push), slider_after(model, moved(push, (x, y), turn))
    frame = np.array([x, y, turn])
    np.testing.assert_allclose(there.pose[:2], to_world(here.pose[:2], frame), atol=1e-9)
    assert there.pose[2] == pytest.approx(here.pose[2] + turn, abs=1e-8)
    whole = np.eye(3)
    whole[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    np.testing.assert_allclose(there.covariance, whole @ here.covariance @ whole.T, rtol=1e-6, atol=1e-14)
    assert here.in_domain == there.in_domain


# --- corners ----------------------------------------------------------------------------------------------------


def at_corner(towards: float, driving: float) -> WorldPush:
    """A tip at the square's corner (0.045, 0.045), off it in direction `towards`, driving in direction `driving`."""
    tip = np.full(2, 0.045) + RADIUS * np.array([np.cos(towards), np.sin(towards)])
    return WorldPush(np.zeros(3), tip, SPEED * np.array([np.cos(driving), np.sin(driving)]), DURATION)


def same(one: SliderAfter, other: SliderAfter) -> None:
    np.testing.assert_allclose(one.pose, other.pose, atol=1e-9)
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-6)


def test_push_at_a_corner_uses_the_edge_that_faces_the_tip() -> None:
    """Edge 2 of the square faces +x and ends at this corner; edge 3 faces +y and begins there."""
    model, driving = model_of("rect1"), np.radians(225.0)
    end_of_2, start_of_3 = (
        slider_after(model, replace(push_at("rect1", c, a, pose=(0.0, 0.0, 0.0)), pusher=p))
        for c, a, p in (
            (0.75 - 1e-12, np.radians(45.0), at_corner(0.1, 0.0).pusher),
            (0.75, np.radians(-45.0), at_corner(1.4, 0.0).pusher),
        )
    )
    same(slider_after(model, at_corner(0.1, driving)), end_of_2)
    same(slider_after(model, at_corner(1.4, driving)), start_of_3)
    assert np.abs(end_of_2.pose - start_of_3.pose).max() > 1e-5


@pytest.mark.parametrize("towards", [0.1, 0.7, 0.9, 1.4])
def test_push_at_a_corner_uses_the_other_edge_if_the_nearer_is_not_pushed(towards: float) -> None:
    """Driving along -x pushes on edge 2 and slides along edge 3, whichever is nearer to the tip."""
    model = model_of("rect1")
    expected = model.predict_rows(np.array([[SPEED, 0.75 - 1e-12, 0.0]]), np.array([DURATION])).mean[0]
    after = slider_after(model, at_corner(towards, np.pi))
    np.testing.assert_allclose(after.pose, expected * [-1.0, -1.0, 1.0], atol=1e-9)


# --- replayed windows -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_recorded_windows_get_the_prediction_of_the_validator() -> None:
    """The tip's line at a window's start leads to the window's contact and to the same outcome."""
    recording, tabulated = read_recording(BAGS / "square_abs_test"), tabulate(model_of("rect1", "vhgp"))
    windows = find_windows(recording, recording.rig)[::4]
    table = windows_to_table(windows)
    shown = tabulated.predict_rows(table.inputs, table.duration, table.covariates)
    headings = np.array([window.push_heading for window in windows])
    poses = displaced(np.array([window.slider_start for window in windows]), headings, shown.mean)
    spreads = covariance_in_world(shown.covariance, headings)
    pusher, origin = Track(2), int(recording.pusher.stamp[0])
    tips = np.column_stack([recording.pusher.x, recording.pusher.y])
    pusher.extend(pusher.order.take(recording.pusher.stamp, tips, True), origin)
    for window, pose, spread, in_domain in zip(windows, poses, spreads, shown.in_domain, strict=True):
        begin, end = (np.array([stamp - origin]) * NANOSECOND for stamp in (window.start, window.end))
        (place,), (velocity,) = pusher_motion(pusher, begin, end)
        push = WorldPush(window.slider_start, place, velocity, window.duration, window.covariates)
        after = slider_after(tabulated, push)
        np.testing.assert_allclose(after.pose, pose, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(after.covariance, spread, rtol=1e-5, atol=1e-15)
        assert after.in_domain == in_domain
    assert len(windows) > 100


# --- covariates -------------------------------------------------------------------------------------------------


def leaning(covariate: str) -> PushModel:
    """A model in which dx grows with a covariate."""
    base = model_of("rect1")
    form = DriverBasis("linear", (covariate,), (0.0,), (1.0,))
    effect = Effect("contact_friction", covariate, form, np.array([0.1]), np.array([[1e-4]]), np.ones(3))
    training = replace(base.training, covariates={covariate: np.linspace(-4.0, 4.0, len(base.training))})
    predictor = ExtendedPredictor(base.predictor.base, (effect,), np.ones(3))
    return replace(base, predictor=predictor, training=training)


@pytest.mark.parametrize("name", TOLD)
def test_covariates_known_from_the_poses_can_be_omitted(name: str) -> None:
    model, push = leaning(name), push_at("rect1", 0.1, -0.5, gap=4e-4, pose=(0.4, -0.3, 7.0))
    assert model.needs == (name,)
    heading = float(np.arctan2(push.velocity[1], push.velocity[0]))
    value = dict(zip(TOLD, (0.4, -0.3, 7.0 - 2.0 * np.pi, heading, 4e-4), strict=True))[name]
    expected = model.predict_rows(np.array([[SPEED, 0.1, -0.5]]), np.array([DURATION]), {name: np.array([value])})
    after = slider_after(model, push)
    np.testing.assert_allclose(
        after.pose, displaced(push.slider[None], np.array([heading]), expected.mean)[0], atol=1e-9
    )
    same(slider_after(model, replace(push, covariates={name: value})), after)
    if name.endswith("heading"):
        same(slider_after(model, replace(push, covariates={name: value + 2.0 * np.pi})), after)


@pytest.mark.parametrize("name", TOLD)
@pytest.mark.parametrize("off", [0.01, -0.01, np.nan])
def test_rejects_a_covariate_that_contradicts_the_poses(name: str, off: float) -> None:
    push = push_at("rect1", 0.1, 0.0, pose=(0.0, 0.0, 0.0))
    message = refusal(replace(push, covariates={name: off}))
    assert message.startswith(f"covariate {name}: {off!r} is not accepted, give ")
    assert "which follows from the poses, or omit it" in message


def test_other_covariates_are_required() -> None:
    model, push = leaning("elapsed_time"), push_at("rect1", 0.1, -0.5)
    assert refusal(push, model).startswith("covariate elapsed_time: 'missing'")
    early, late = (slider_after(model, replace(push, covariates={"elapsed_time": t})).pose for t in (0.0, 3.0))
    assert np.abs(early - late).max() > 1e-6
    assert not slider_after(model, replace(push, covariates={"elapsed_time": 9.0})).in_domain


# --- refusals ---------------------------------------------------------------------------------------------------


SOUND = push_at("rect1", 0.1, 0.2)
REFUSED = [
    (replace(SOUND, slider=np.array([0.0, np.nan, 0.0])), "slider: (0.0, nan, 0.0) is not accepted, give finite numb"),
    (replace(SOUND, pusher=np.array([np.inf, 0.0])), "pusher: (inf, 0.0)"),
    (replace(SOUND, velocity=np.array([np.nan, 0.0])), "pusher_velocity: (nan, 0.0)"),
    (replace(SOUND, velocity=np.zeros(2)), "pusher_velocity: (0.0, 0.0) is not accepted, give a velocity above 0"),
    (replace(SOUND, duration=0.0), "duration: 0.0"),
    (push_at("rect1", 0.1, 0.2, gap=0.0123), "the gap to the outline is 0.0123 m, at most 0.001 m is contact"),
    (push_at("rect1", 0.1, 0.2, gap=1.01 * MAX_GAP), "m is contact"),
    (push_at("rect1", 0.1, 0.2, gap=-0.004), "it is 0.004 m inside the outline, at most"),
    (push_at("rect1", 0.1, 0.2, gap=-1.01 * MAX_DEPTH), "m is contact"),
    *(
        (push_at("rect1", 0.1, angle, gap=-RADIUS - 0.002), "outside the slider: its centre is 0.002 m inside")
        for angle in (0.2, np.pi - 0.2)
    ),
    *(
        (push_at("rect1", 0.1, np.radians(degrees) * (1.0 + 1e-12)), f"it is {degrees:.1f} degrees from it")
        for degrees in (90.0, -100.0, 135.0)
    ),
    *((at_corner(np.pi / 4.0, driving), "degrees from it") for driving in (0.0, np.pi / 4.0, np.pi / 2.0)),
]


@pytest.mark.parametrize(("push", "stated"), REFUSED, ids=range(len(REFUSED)))
def test_what_is_no_push_is_refused_by_field(push: WorldPush, stated: str) -> None:
    assert stated in refusal(push)


@pytest.mark.parametrize("shape", ["rect1", "ellip2"])
@pytest.mark.parametrize("gap", [0.99 * MAX_GAP, -0.99 * MAX_DEPTH])
def test_a_tip_within_the_errors_of_tracker_and_outline_touches(shape: str, gap: float) -> None:
    assert np.isfinite(slider_after(model_of(shape), push_at(shape, 0.1, 0.2, gap)).pose).all()
