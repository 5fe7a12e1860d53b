# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Properties of every push, pose and sampling, checked by hypothesis.

Round trips of single messages are in test_msg_adapters.py, rigid motions of the world in test_windows.py, sides of a
square in test_push_model.py: here is what these leave open.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from decoding import input_of
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_messages import pose_message, wrench_message
from rclpy.serialization import serialize_message
from synthetic import Push, moved, translating_push, windows_of

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.slider_pose import WorldPush, slider_after
from push_predictor.recordings.bag.message_types import POSE, WRENCH
from push_predictor.recordings.decoder.decoder import StreamDecoder
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.topics import Topics
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, simulate
from push_predictor.types import Array

RADIUS = 0.00475
# (shape, kind): a square, a hexagon, a circle and an ellipse; each kind is there with and without corners.
MODELS = [(shape, kind) for shape, *kinds in (
    ("rect1", "vhgp", "analytical"), ("hex", "gp"), ("ellip1", "analytical", "gp"), ("ellip3", "vhgp")
) for kind in kinds]  # fmt: skip
METRES, TURNS = st.floats(-2.0, 2.0), st.floats(-20.0, 20.0)


# --- adapters: a whole recording through messages --------------------------------------------------------------------


def through_messages(recording: Recording) -> Recording:
    """The recording as a subscribing node receives it: serialized messages, headings as quaternions."""
    wrench = recording.wrench
    assert wrench is not None
    forces = zip(wrench.stamp.tolist(), wrench.fx, wrench.fy, wrench.torque, strict=True)
    decoder = StreamDecoder(Topics(), expected="world")
    messages = {"slider": poses(recording.slider), "pusher": poses(recording.pusher)}
    for name, own in decoder.inputs().items():
        sent = messages.get(name) or [wrench_message(*row) for row in forces]
        input_of(own, (POSE if name in messages else WRENCH).name, *map(serialize_message, sent))
    found = decoder.take(last=True)
    return replace(recording, slider=found.slider, pusher=found.pusher, wrench=found.wrench)


def poses(stream: PoseStream) -> list[PoseStamped]:
    columns = zip(stream.stamp.tolist(), stream.x, stream.y, stream.z, stream.heading, strict=True)
    return [pose_message(*row) for row in columns]


@settings(max_examples=3, deadline=None)
@given(shift=st.tuples(METRES, METRES), turn=TURNS, contact=st.floats(0.0, 0.999))
def test_windows_are_the_same_after_ros_messages_in_any_world_frame(
    shift: tuple[float, float], turn: float, contact: float
) -> None:
    """Any rotation, also one with which the heading wraps during a push."""
    here = translating_push(contact=contact)
    there = through_messages(moved(here, np.array(shift), turn))
    for a, b in zip(windows_of(here), windows_of(there), strict=True):
        assert (a.start, a.end, a.push_id) == (b.start, b.end, b.push_id)
        assert (a.velocity, a.contact, a.angle) == pytest.approx((b.velocity, b.contact, b.angle), abs=1e-9)
        assert a.displacement == pytest.approx(b.displacement, abs=1e-9)
        for name in ("normal_force", "tangential_force"):
            assert a.covariates[name] == pytest.approx(b.covariates[name], abs=1e-9)


@cache
def simulated() -> Recording:
    plan = random_pushes(2, [0.05], 0.03, np.random.default_rng(3))
    return simulate(SimulationSpec("rect1", "abs", plan, name="two"))


def mirrored(recording: Recording) -> Recording:
    """The mirror image about the world's x axis."""
    wrench = recording.wrench
    assert wrench is not None
    return replace(
        recording,
        slider=replace(recording.slider, y=-recording.slider.y, heading=-recording.slider.heading),
        pusher=replace(recording.pusher, y=-recording.pusher.y, heading=-recording.pusher.heading),
        wrench=WrenchStream(wrench.stamp, wrench.fx, -wrench.fy, -wrench.torque),
    )


@settings(max_examples=3, deadline=None)
@given(turn=TURNS)
def test_mirrored_recording_has_mirrored_windows(turn: float) -> None:
    outline = shape_outline("rect1")
    here, there = simulated(), mirrored(moved(simulated(), np.zeros(2), turn))
    windows = windows_of(here)
    assert len(windows) >= 4 and max(abs(w.displacement[2]) for w in windows) > 0.02
    for a, b in zip(windows, windows_of(there), strict=True):
        assert (a.start, a.velocity) == (b.start, pytest.approx(b.velocity, abs=1e-9))
        assert a.angle == pytest.approx(-b.angle, abs=1e-9)
        assert a.displacement * [1.0, -1.0, -1.0] == pytest.approx(b.displacement, abs=1e-9)
        image = outline.point(np.array([a.contact])) * [1.0, -1.0]
        assert outline.point(np.array([b.contact])) == pytest.approx(image, abs=1e-9)
        assert a.covariates["tangential_force"] == pytest.approx(-b.covariates["tangential_force"], abs=1e-9)


# --- windows: sampling rates of the streams ------ --------------------------------------------------------------------

RATES = st.floats(60.0, 1000.0)


@settings(max_examples=12, deadline=None)
@given(slider=RATES, pusher=RATES, wrench=RATES, contact=st.floats(0.0, 0.999))
def test_windows_do_not_depend_on_the_rates_of_the_streams(
    slider: float, pusher: float, wrench: float, contact: float
) -> None:
    push = Push(begin=0.5, end=1.6)
    at = {rate: translating_push(push, contact=contact, rate=rate) for rate in (100.0, slider, pusher, wrench)}
    streams = {"slider": at[slider].slider, "pusher": at[pusher].pusher, "wrench": at[wrench].wrench}
    expected, found = windows_of(at[100.0]), windows_of(replace(at[100.0], **streams))
    assert len(expected) == len(found) == 5
    sample = 0.01 + 1.0 / min(slider, pusher, wrench)  # s by which a touch may be seen earlier or later
    for k, (a, b) in enumerate(zip(expected, found, strict=True)):
        assert (a.start - b.start) * 1e-9 == pytest.approx(0.0, abs=sample)
        assert (a.velocity, a.contact, a.angle) == pytest.approx((b.velocity, b.contact, b.angle), abs=1e-6)
        # The slider starts to move within the first window, between two samples.
        assert a.displacement == pytest.approx(b.displacement, abs=1e-9 if k else push.speed * sample)


# --- predictions -----------------------------------------------------------------------------------------------------


@cache
def model_of(shape: str, kind: str) -> PushModel:
    """Trained on 40 noisy pushes of an analytical slider."""
    rig, rng, n = Rig(shape, shape_outline(shape), RADIUS, "abs", 0.8), np.random.default_rng(0), 40
    inputs = np.column_stack([rng.uniform(0.01, 0.05, n), rng.random(n), rng.uniform(-1.0, 1.0, n)])
    duration = np.full(n, 0.2)
    noise = rng.standard_normal((n, 3)) * [1e-4, 1e-4, 3e-3] * (0.3 + np.abs(inputs[:, 2:]))
    outcomes = analytical_mechanics(rig.outline, RADIUS).displacement(inputs, duration) + noise
    table = PushTable(inputs, duration, outcomes, np.array([f"p{k // 3}" for k in range(n)]))
    return train_model(table, rig, kind, name=f"{shape}_{kind}", options=TrainingOptions(mean="zero"))


@cache
def tabulated(shape: str, kind: str) -> TabulatedModel:
    return tabulate(model_of(shape, kind))


@given(
    which=st.sampled_from(MODELS),
    from_table=st.booleans(),
    contact=st.floats(0.01, 0.99),
    angle=st.floats(-1.2, 1.2),
    turn=TURNS,
    slider=st.tuples(METRES, METRES, TURNS),
)
def test_prediction_is_invariant_to_rotational_symmetry(
    which: tuple[str, str],
    from_table: bool,
    contact: float,
    angle: float,
    turn: float,
    slider: tuple[float, float, float],
) -> None:
    """The same tip touches another side: the outcome in the world is the same, the heading differs by the rotation."""
    outline = shape_outline(which[0])
    order = outline.rotational_symmetry
    turned = turn if order == 0 else 2.0 * np.pi / order * round(turn)
    predictor = tabulated(*which) if from_table else model_of(*which)
    x, y, heading = slider
    here = tip_at(outline.point(np.array([contact]))[0], outline.inward_normal(np.array([contact]))[0], slider, angle)
    there = replace(here, slider=np.array([x, y, heading + turned]))
    a, b = slider_after(predictor, here), slider_after(predictor, there)
    # A table stores one value for all sides; the contact is recomputed from the rotated poses, up to rounding.
    assert b.pose - a.pose == pytest.approx([0.0, 0.0, turned], abs=1e-7)
    assert b.covariance == pytest.approx(a.covariance, rel=1e-5, abs=1e-13)


def tip_at(point: Array, normal: Array, slider: tuple[float, float, float], angle: float) -> WorldPush:
    """The tip touches this point of the outline and moves at this angle from the normal."""
    x, y, heading = slider
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    aside = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    tip = turn @ (point - RADIUS * normal) + [x, y]
    return WorldPush(np.array(slider), tip, 0.02 * (turn @ aside @ normal), 0.2)


@given(
    which=st.sampled_from(MODELS),
    from_table=st.booleans(),
    velocity=st.floats(1e-4, 1e3),
    contact=st.floats(0.0, 1.0, exclude_max=True),
    angle=st.floats(-1.57, 1.57),
)
def test_covariances_are_symmetric_and_positive_definite_in_and_out_of_the_domain(
    which: tuple[str, str], from_table: bool, velocity: float, contact: float, angle: float
) -> None:
    predictor = tabulated(*which) if from_table else model_of(*which)
    if which[1] == "analytical":
        velocity = min(velocity, 0.2)  # mechanics rejects paths of metres, which would take minutes
    prediction: Prediction = predictor.predict_rows(np.array([[velocity, contact, angle]]), np.array([0.2]))
    (total,), (process,) = prediction.covariance, prediction.process_covariance
    for covariance in (total, process):
        assert np.array_equal(covariance, covariance.T)
        sd = np.sqrt(np.diag(covariance))
        assert np.all(sd > 0.0) and np.linalg.eigvalsh(covariance / np.outer(sd, sd))[0] > 1e-9
    sd = np.sqrt(np.diag(total))
    assert np.linalg.eigvalsh((total - process) / np.outer(sd, sd))[0] > -1e-9
