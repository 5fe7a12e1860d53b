# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Requests in the world frame and in other frames: poses in space, messages, and a fake tf.

The tests cannot install tf2_ros. FakeTf replaces it, and checks only that it is called as documented.
"""

from __future__ import annotations

import math
import sys
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from scipy.spatial.transform import Rotation
from std_msgs.msg import Header
from synthetic import square_pushes

from msg_adapters.slider_poses import FLAT, fill_slider_response, world_push, world_slider
from push_predictor.errors import RequestError
from push_predictor.geometry.frames import SAME_FRAME, SpatialPose, vertical_turn
from push_predictor.models.store.model_file import save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import train_model
from push_predictor.nodes.server.services import RequestFrames, handle_predict_slider_pose
from push_predictor.planning.slider_pose import SliderAfter, WorldPush, slider_after
from push_predictor_interfaces.srv import PredictSliderPose

COVARIANCE = np.array([[4e-8, 1e-8, 3e-7], [1e-8, 1e-8, 2e-7], [3e-7, 2e-7, 3e-5]])
NUMBERS = st.floats(-3.0, 3.0)
POSES = st.builds(
    lambda p, q: SpatialPose(np.array(p), np.array(q) / np.linalg.norm(q)),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS).filter(lambda q: np.linalg.norm(q) > 0.1),
)
TABLE_TOP = SpatialPose(np.array([0.5, -0.3, 0.8]), vertical_turn(2.0))  # flat, but rotated and translated
CAMERA = SpatialPose(np.array([1.0, 0.2, 1.5]), Rotation.from_euler("xyz", [2.4, 0.3, -1.0]).as_quat())  # looks down


def slider_request(frame_id: str = "world", **change: Any) -> PredictSliderPose.Request:
    """A tip that moves along x at the first edge of the square, whose pose is (0.3, 0.1, 0.02) without rotation."""
    request = PredictSliderPose.Request(
        header=Header(stamp=Time(sec=100, nanosec=900_000_000), frame_id=frame_id),
        slider=Pose(position=Point(x=0.3, y=0.1, z=0.02), orientation=Quaternion(w=1.0)),
        pusher=Point(x=0.3 - 0.045 - 0.00475, y=0.11, z=0.03),
        pusher_velocity=Vector3(x=0.02, y=0.004),
        duration=0.2,
    )
    for name, value in change.items():
        *path, last = name.split("__")
        place = request
        for part in path:
            place = getattr(place, part)
        setattr(place, last, value)
    return request


def seen_from(frame: SpatialPose, request: PredictSliderPose.Request, frame_id: str) -> PredictSliderPose.Request:
    """The same request in another frame."""
    there, tip, motion = frame.inverse, request.pusher, request.pusher_velocity
    slider = there @ world_slider("slider", request.slider, SAME_FRAME).pose
    pusher, velocity = (
        there.point(np.array([tip.x, tip.y, tip.z])),
        there.vector(np.array([motion.x, motion.y, motion.z])),
    )
    request = slider_request(frame_id)
    request.slider = Pose(position=Point(**axes(slider.position)), orientation=Quaternion(**axes(slider.quaternion)))
    request.pusher, request.pusher_velocity = Point(**axes(pusher)), Vector3(**axes(velocity))
    return request


def axes(values: np.ndarray) -> dict[str, float]:
    return dict(zip("xyzw", values.tolist(), strict=False))


def pose_of(answer: Any) -> SpatialPose:
    pose = answer.pose.pose
    position, turn = pose.position, pose.orientation
    return SpatialPose(np.array([position.x, position.y, position.z]), np.array([turn.x, turn.y, turn.z, turn.w]))


def assert_same_pose(one: SpatialPose, other: SpatialPose, atol: float = 1e-12) -> None:
    np.testing.assert_allclose(one.position, other.position, atol=atol)
    np.testing.assert_allclose(one.rotation, other.rotation, atol=atol)


# --- poses in space ---------------------------------------------------------------------------------------------


@given(POSES, POSES, st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array))
def test_poses_compose_as_rotations_and_translations(outer: SpatialPose, inner: SpatialPose, point: np.ndarray) -> None:
    np.testing.assert_allclose(outer.rotation, Rotation.from_quat(outer.quaternion).as_matrix(), atol=1e-12)
    np.testing.assert_allclose((outer @ inner).point(point), outer.point(inner.point(point)), atol=1e-12)
    np.testing.assert_allclose(outer.inverse.point(outer.point(point)), point, atol=1e-12)
    np.testing.assert_allclose(outer.vector(point), outer.point(point) - outer.point(np.zeros(3)), atol=1e-12)
    assert_same_pose(outer.inverse @ (outer @ inner), inner)
    assert_same_pose(SAME_FRAME @ inner, inner, atol=0.0)


@given(POSES, NUMBERS)
def test_tilt_is_the_angle_between_the_vertical_axes(pose: SpatialPose, turn: float) -> None:
    up = pose.vector(np.array([0.0, 0.0, 1.0]))
    assert pose.tilt == pytest.approx(np.arctan2(np.hypot(*up[:2]), up[2]), abs=1e-7)
    assert pose.turned(turn).tilt == pytest.approx(pose.tilt, abs=1e-7)
    before, after = (Rotation.from_quat(p.quaternion) for p in (pose, pose.turned(turn)))
    np.testing.assert_allclose(
        (after * before.inv()).as_matrix(), Rotation.from_euler("z", turn).as_matrix(), atol=1e-12
    )


def test_a_covariance_is_that_of_samples_in_the_other_frame() -> None:
    """Small errors of a pose, drawn in one frame: translation and rotation vector about fixed axes."""
    rng = np.random.default_rng(0)
    root = 1e-4 * rng.standard_normal((6, 6))
    body, outer = SpatialPose(np.array([0.1, 0.2, 0.3]), CAMERA.quaternion), TABLE_TOP @ CAMERA
    seen, base = [], outer @ body
    for error in rng.standard_normal((2000, 6)) @ root.T:
        turned = Rotation.from_rotvec(error[3:]) * Rotation.from_quat(body.quaternion)
        there = outer @ SpatialPose(body.position + error[:3], turned.as_quat())
        turn = Rotation.from_quat(there.quaternion) * Rotation.from_quat(base.quaternion).inv()
        seen.append(np.concatenate([there.position - base.position, turn.as_rotvec()]))
    expected = outer.covariance(root @ root.T)
    assert np.abs(np.cov(np.array(seen).T) - expected).max() < 0.1 * np.abs(expected).max()
    # The draws themselves rotate exactly, whatever their spread:
    errors = np.random.default_rng(0)
    errors.standard_normal((6, 6))
    drawn = errors.standard_normal((2000, 6)) @ root.T
    np.testing.assert_allclose(np.cov(np.array(seen).T), outer.covariance(np.cov(drawn.T)), atol=1e-3 * expected.max())


# --- messages ---------------------------------------------------------------------------------------------------


def pushed(request: Any, frame: SpatialPose = SAME_FRAME) -> WorldPush:
    return world_push(request, world_slider("slider", request.slider, frame), frame, request.duration)


def answered(request: Any, after: SliderAfter, frame: SpatialPose = SAME_FRAME) -> PredictSliderPose.Response:
    response, slider = PredictSliderPose.Response(), world_slider("slider", request.slider, frame)
    fill_slider_response(response, request.header, frame, slider, request.duration, after)
    return deserialize_message(serialize_message(response), PredictSliderPose.Response)


def test_a_request_becomes_a_push_in_the_world() -> None:
    request = slider_request(
        slider__orientation=Quaternion(z=np.sin(0.35), w=np.cos(0.35)),
        covariate_names=["elapsed_time", "topic:/warmth"],
        covariate_values=[3.0, 21.5],
    )
    push = pushed(request)
    np.testing.assert_allclose(push.slider, [0.3, 0.1, 0.7], atol=1e-15)
    np.testing.assert_array_equal(push.pusher, [0.3 - 0.045 - 0.00475, 0.11])
    np.testing.assert_array_equal(push.velocity, [0.02, 0.004])
    assert push.duration == 0.2
    assert push.covariates == {"elapsed_time": 3.0, "topic:/warmth": 21.5}


def test_a_response_is_a_pose_with_covariance_in_the_order_of_geometry_msgs() -> None:
    response = answered(slider_request(), SliderAfter(np.array([0.304, 0.101, 0.05]), COVARIANCE, True))
    assert response.success and response.in_domain and response.message == ""
    after = response.slider_after
    assert after.header.frame_id == "world"
    assert (after.header.stamp.sec, after.header.stamp.nanosec) == (101, 100_000_000)  # 100.9 s and the push of 0.2 s
    pose = pose_of(after)
    np.testing.assert_array_equal(pose.position, [0.304, 0.101, 0.02])  # the slider stays on the table
    np.testing.assert_allclose(pose.quaternion, [0.0, 0.0, np.sin(0.025), np.cos(0.025)], atol=1e-15)
    assert (pose.quaternion[:2] == 0.0).all()
    matrix = np.array(after.pose.covariance).reshape(6, 6)
    np.testing.assert_array_equal(matrix[np.ix_([0, 1, 5], [0, 1, 5])], COVARIANCE)
    others = [2, 3, 4]
    assert not matrix[others].any() and not matrix[:, others].any()


def test_an_unknown_time_stays_unknown() -> None:
    after = answered(slider_request(header__stamp=Time()), SliderAfter(np.zeros(3), COVARIANCE, False)).slider_after
    assert (after.header.stamp.sec, after.header.stamp.nanosec) == (0, 0)


def test_rejects_a_time_beyond_32_bit_seconds() -> None:
    with pytest.raises(RequestError, match="stamp"):
        answered(slider_request(duration=1e10), SliderAfter(np.zeros(3), COVARIANCE, False))


def test_a_small_tilt_does_not_change() -> None:
    tilted = Rotation.from_euler("z", 0.4) * Rotation.from_euler("xy", [0.03, -0.02])
    request = slider_request(slider__orientation=Quaternion(**axes(tilted.as_quat())))
    response = answered(request, SliderAfter(np.array([0.3, 0.1, 0.4 + 0.2]), COVARIANCE, True))
    turned = Rotation.from_quat(pose_of(response.slider_after).quaternion) * tilted.inv()
    assert turned.as_rotvec() == pytest.approx(
        [0.0, 0.0, 0.2], abs=2e-3
    )  # the heading of a tilted body is not its turn
    assert pose_of(response.slider_after).tilt == pytest.approx(
        SpatialPose(np.zeros(3), tilted.as_quat()).tilt, abs=1e-9
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("field", "shown"),
    [(f"slider__position__{axis}", f"slider.position.{axis}") for axis in "xyz"]
    + [(f"slider__orientation__{axis}", f"slider.orientation.{axis}") for axis in "xyzw"]
    + [(f"pusher__{axis}", f"pusher.{axis}") for axis in "xyz"]
    + [(f"pusher_velocity__{axis}", f"pusher_velocity.{axis}") for axis in "xyz"],
)
def test_rejects_numbers_that_are_not_finite_by_field(field: str, shown: str, bad: float) -> None:
    with pytest.raises(RequestError, match=f"^{shown}: {bad!r} is not accepted, give a finite number"):
        pushed(slider_request(**{field: bad}))


@pytest.mark.parametrize(
    ("change", "begins"),
    [
        ({"slider__orientation": Quaternion(w=0.0)}, "slider.orientation norm: 0.0 is not accepted, give a unit"),
        ({"slider__orientation": Quaternion(w=1.01)}, "slider.orientation norm: 1.01"),
        ({"slider__orientation": Quaternion(x=1.0, w=0.0)}, "slider.orientation tilt: 3.1416"),  # on its head
        ({"slider__orientation": Quaternion(x=math.sin(0.06), w=math.cos(0.06))}, "slider.orientation tilt: 0.12 "),
        ({"pusher__z": 0.05}, "pusher.z: 0.05 is not accepted, give a tip at most 0.02 m above the slider's frame"),
        ({"pusher_velocity__z": -0.01}, "pusher_velocity.z: -0.01 is not accepted, give a velocity within 0.1 rad"),
        ({"pusher_velocity": Vector3(z=0.01)}, "pusher_velocity.z: 0.01"),
    ],
)
def test_rejects_a_push_out_of_the_plane_by_field(change: dict[str, Any], begins: str) -> None:
    with pytest.raises(RequestError) as caught:
        pushed(slider_request(**change))
    assert str(caught.value).startswith(begins)


def test_accepts_the_errors_of_a_tracker_out_of_the_plane() -> None:
    half = 0.45 * FLAT
    orientation = Quaternion(y=math.sin(half), w=math.cos(half))
    pushed(slider_request(slider__orientation=orientation, pusher_velocity__z=0.0015, pusher__z=0.0))


# --- other frames -----------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(POSES)
def test_every_frame_in_space_gives_the_same_push_and_outcome(frame: SpatialPose) -> None:
    asked, elsewhere = slider_request(), seen_from(frame, slider_request(), "elsewhere")
    here, there = pushed(asked), pushed(elsewhere, frame)
    for name in ("slider", "pusher", "velocity"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=1e-12)
    expected, found = slider_after(analytical(), here), slider_after(analytical(), there)
    np.testing.assert_allclose(found.pose, expected.pose, atol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6, atol=1e-16)
    after = SliderAfter(np.array([0.304, 0.101, 0.05]), COVARIANCE, True)
    in_world, in_frame = (answered(asked, after).slider_after, answered(elsewhere, after, frame).slider_after)
    assert in_frame.header.frame_id == "elsewhere"
    assert_same_pose(frame @ pose_of(in_frame), pose_of(in_world))
    world, own = (np.array(a.pose.covariance).reshape(6, 6) for a in (in_world, in_frame))
    np.testing.assert_array_equal(own, own.T)
    np.testing.assert_allclose(frame.covariance(own), world, atol=1e-18)


def test_a_flat_frame_gets_a_flat_response() -> None:
    """The transform adds no height, roll or pitch; the heading's variance is the same in both frames."""
    elsewhere = seen_from(TABLE_TOP, slider_request(), "table_top")
    after = answered(elsewhere, SliderAfter(np.array([0.304, 0.101, 0.05]), COVARIANCE, True), TABLE_TOP).slider_after
    pose, matrix = pose_of(after), np.array(after.pose.covariance).reshape(6, 6)
    assert (pose.quaternion[:2] == 0.0).all()
    assert not matrix[[2, 3, 4]].any()
    assert matrix[5, 5] == pytest.approx(3e-5, rel=1e-12)
    assert np.linalg.eigvalsh(matrix[:2, :2]) == pytest.approx(np.linalg.eigvalsh(COVARIANCE[:2, :2]), rel=1e-9)


def test_rejects_a_slider_that_is_flat_only_in_its_own_frame() -> None:
    with pytest.raises(RequestError, match=r"slider\.orientation tilt"):
        pushed(slider_request("camera"), CAMERA)


# --- which frames are known -------------------------------------------------------------------------------------


class FakeError(Exception):
    """Replaces tf2_ros.TransformException."""


class FakeBuffer:
    """Replaces tf2_ros.Buffer: knows `table_top` and `camera` in `world`, from 50 s on."""

    asked: list[tuple[str, str, int]]

    def __init__(self) -> None:
        self.asked = []

    def lookup_transform(self, target_frame: str, source_frame: str, time: Any) -> Any:  # no timeout: it would block
        self.asked.append((target_frame, source_frame, time.nanoseconds))
        known = {"table_top": TABLE_TOP, "camera": CAMERA}
        if source_frame not in known:
            raise FakeError(f'"{source_frame}" passed to lookupTransform argument source_frame does not exist.')
        if 0 < time.nanoseconds < 50_000_000_000:
            raise FakeError("Lookup would require extrapolation into the past.")
        pose = known[source_frame]
        transform = Transform(translation=Vector3(**axes(pose.position)), rotation=Quaternion(**axes(pose.quaternion)))
        return SimpleNamespace(transform=transform)


class FakeTf(SimpleNamespace):
    """Replaces the module tf2_ros."""

    def __init__(self) -> None:
        self.buffers: list[FakeBuffer] = []
        self.listeners: list[tuple[Any, Any]] = []
        super().__init__(TransformException=FakeError)

    def Buffer(self) -> FakeBuffer:  # noqa: N802 (its name in tf2_ros)
        self.buffers.append(FakeBuffer())
        return self.buffers[-1]

    def TransformListener(self, buffer: Any, node: Any) -> object:  # noqa: N802 (its name in tf2_ros)
        self.listeners.append((buffer, node))
        return object()


@pytest.fixture
def tf(monkeypatch: pytest.MonkeyPatch) -> FakeTf:
    made_up = FakeTf()
    monkeypatch.setitem(sys.modules, "tf2_ros", made_up)
    return made_up


def header(frame_id: str, sec: int = 100) -> Header:
    return Header(frame_id=frame_id, stamp=Time(sec=sec))


@pytest.mark.parametrize("installed", [False, True])
@pytest.mark.parametrize(
    ("frame_id", "words"),
    [
        ("", "'' is not accepted, give the frame of the poses, such as 'world'"),
        ("/world", "'/world' is not accepted, give 'world', without a slash"),
        ("map", "'map' is not accepted, give 'world'"),
        ("World", "'World' is not accepted, give 'world'"),
    ],
)
def test_rejects_another_frame_by_name_and_the_world_needs_no_transform(
    tf: FakeTf, frame_id: str, words: str, installed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not installed:
        monkeypatch.setitem(sys.modules, "tf2_ros", None)  # importing it fails
    frames = RequestFrames(object(), "world")
    assert frames.pose_in_world(header("world")) is SAME_FRAME
    with pytest.raises(RequestError) as caught:
        frames.pose_in_world(header(frame_id))
    assert str(caught.value).startswith(f"header.frame_id: {words}")
    looked_up = frame_id.lower() in ("map", "world")
    assert not looked_up or installed or str(caught.value).endswith("; tf2_ros is not installed")
    assert [source for buffer in tf.buffers for _, source, _ in buffer.asked] == [frame_id] * (looked_up and installed)


def test_looks_up_the_frame_in_the_world_at_the_stamp(tf: FakeTf) -> None:
    node = object()
    frames = RequestFrames(node, "world")
    assert tf.listeners == [(tf.buffers[0], node)]
    assert_same_pose(frames.pose_in_world(header("camera", 100)), CAMERA)
    assert_same_pose(frames.pose_in_world(header("table_top", 0)), TABLE_TOP)  # zero: the latest
    assert frames.pose_in_world(header("world")) is SAME_FRAME
    assert tf.buffers[0].asked == [("world", "camera", 100_000_000_000), ("world", "table_top", 0)]


@pytest.mark.parametrize(("frame_id", "sec", "error"), [("map", 100, '"map" passed'), ("camera", 10, "extrapolation")])
def test_passes_on_the_error_of_tf(tf: FakeTf, frame_id: str, sec: int, error: str) -> None:
    with pytest.raises(RequestError) as caught:
        RequestFrames(object(), "world").pose_in_world(header(frame_id, sec))
    assert str(caught.value).startswith(f"header.frame_id: {frame_id!r} is not accepted, give 'world', or a frame")
    assert error in str(caught.value)


@cache
def analytical() -> Any:
    return train_model(*square_pushes(30), "analytical", name="square")


def test_a_request_in_a_frame_of_tf_is_answered_in_that_frame(tf: FakeTf, tmp_path: Any) -> None:
    registry, frames = ModelRegistry(), RequestFrames(object(), "world")
    save_model(analytical(), tmp_path / "square.model")
    registry.load(tmp_path / "square.model")
    here, there = PredictSliderPose.Response(), PredictSliderPose.Response()
    handle_predict_slider_pose(frames, registry, slider_request(), here)
    handle_predict_slider_pose(frames, registry, seen_from(CAMERA, slider_request(), "camera"), there)
    assert here.success and there.success
    assert here.slider_after.header.frame_id == "world" and there.slider_after.header.frame_id == "camera"
    assert_same_pose(CAMERA @ pose_of(there.slider_after), pose_of(here.slider_after), atol=1e-9)
    world, own = (np.array(r.slider_after.pose.covariance).reshape(6, 6) for r in (here, there))
    np.testing.assert_allclose(CAMERA.covariance(own), world, atol=1e-12)
    assert world.any()
