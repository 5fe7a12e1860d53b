# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Worlds whose up axis is not z, and samples that have the time of the log, give the windows of the original."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from decoding import decoded, decoder_of, in_portions
from lab_bags import LATENCY, Lab, pose_rows, short_recording
from test_lab_topics import assert_same_windows, original, wrench
from turning_sensor import add_tip, add_wrench

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.fields.pose_rows import (
    UP_AXES,
    bodies_z_up,
    composed,
    inverted,
    normalised,
    turned,
    wrenches_z_up,
    z_up,
)
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.topics import Topics

POSE, WRENCH = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/WrenchStamped"
VECTORS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}


def turn_of(up: str) -> np.ndarray:
    """The pose (1, 7) of the axes with this axis up in a world with z up."""
    return z_up(np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]), up)


def as_seen(rows: np.ndarray, up: str, bodies: bool) -> np.ndarray:
    """Poses (n, 7) with z up, as a tracker with another axis up reports them; bodies: have its axes, too."""
    turn = np.tile(turn_of(up), (len(rows), 1))
    seen = composed(inverted(turn), rows)
    return composed(seen, turn) if bodies else seen


@pytest.mark.parametrize("up", UP_AXES)
def test_the_up_axis_becomes_z_by_a_turn_and_handedness_stays(up: str) -> None:
    vectors = np.array([VECTORS[up], *np.eye(3)], np.float64)
    found = turned(np.tile(turn_of(up)[:, 3:], (4, 1)), vectors)
    np.testing.assert_allclose(found[0], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(found[1:]), 1.0)
    upright = wrenches_z_up(np.array([[*VECTORS[up], *VECTORS[up]]], np.float64), up)
    np.testing.assert_allclose(upright, [[0, 0, 1, 0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize("up", UP_AXES)
@pytest.mark.parametrize("bodies", [True, False])
def test_poses_are_those_of_the_world_with_z_up(up: str, bodies: bool) -> None:
    rng = np.random.default_rng(0)
    heading = rng.uniform(-3.0, 3.0, 50)
    rows = np.column_stack(
        [rng.normal(size=(50, 3)), 0.05 * rng.normal(size=(50, 2)), np.sin(heading), np.cos(heading)]
    )
    rows = normalised(rows)  # tilted by a few degrees
    found = bodies_z_up(z_up(as_seen(rows, up, bodies), up), up)
    sign = np.sign(np.sum(found[:, 3:] * rows[:, 3:], axis=1, keepdims=True))
    np.testing.assert_allclose(np.hstack([found[:, :3], sign * found[:, 3:]]), rows, atol=1e-12)


@pytest.mark.parametrize("up", [up for up in UP_AXES if up not in ("z", "-z")])
def test_a_body_upside_down_still_has_the_axis_that_is_up(up: str) -> None:
    """A finding names it as upside down; its heading is about the vertical."""
    upside_down = np.array([[0.1, 0.2, 0.0, 1.0, 0.0, 0.0, 0.0]])
    found = bodies_z_up(z_up(as_seen(upside_down, up, bodies=True), up), up)
    np.testing.assert_allclose(turned(found[:, 3:], np.array([[0.0, 0.0, 1.0]])), [[0.0, 0.0, -1.0]], atol=1e-12)


def lab_with(up: str, bodies: bool, streams: tuple[str, ...]) -> Lab:
    """The original as trackers see it; streams: those with another axis up."""
    lab, whole = Lab(), original()
    for name, stream in (("slider", whole.slider), ("pusher", whole.pusher)):
        rows = as_seen(pose_rows(stream), up if name in streams else "z", bodies)
        add_tip(lab, f"/{name}/pose", stream.stamp, rows)
    assert whole.wrench is not None
    n = len(whole.wrench)
    along_z = np.column_stack([whole.wrench.fx, whole.wrench.fy, np.zeros((n, 3)), whole.wrench.torque])
    back = np.tile(turn_of(up)[:, 3:] * [-1, -1, -1, 1], (n, 1))
    both = [turned(back, part) for part in (along_z[:, :3], along_z[:, 3:])] if "wrench" in streams else None
    values = along_z if both is None else np.hstack(both)
    add_wrench(lab, "/pusher/wrench", whole.wrench.stamp, values, "world")
    return lab


@pytest.mark.parametrize(
    ("up", "given", "bodies", "streams"),
    [
        ("y", "y", False, ("slider", "pusher")),
        ("y", "y", True, ("slider", "pusher")),
        ("-z", "-z", True, ("slider", "pusher")),
        ("x", "slider=x", True, ("slider",)),
        ("y", "pusher=y", False, ("pusher",)),
        ("-y", "-y,wrench=-y", True, ("slider", "pusher", "wrench")),
        ("-x", " slider = -x , wrench=-x ", False, ("slider", "wrench")),
    ],
)
def test_each_stream_with_another_up_axis_gives_the_windows_of_the_original(
    tmp_path: Path, up: str, given: str, bodies: bool, streams: tuple[str, ...]
) -> None:
    path = lab_with(up, bodies, streams).mcap(tmp_path / "lab", original().rig)
    assert_same_windows(read_recording(path, topics=Topics(up=given)))


def test_a_live_world_is_turned_portion_by_portion() -> None:
    lab, topics = lab_with("y", True, ("slider", "pusher")), Topics(up="y")
    found = decoded(decoder_of(lab, topics), lab, in_portions(lab.in_order(), 37), live=True)
    np.testing.assert_allclose(found.slider.heading, original().slider.heading, atol=1e-9)
    np.testing.assert_allclose(found.pusher.z, original().pusher.z, atol=1e-12)


def test_a_sensor_with_the_axes_of_the_tip_is_turned_with_it(tmp_path: Path) -> None:
    plain, up = lab_with("z", False, ()), lab_with("y", True, ("slider", "pusher"))
    paths = plain.mcap(tmp_path / "a", original().rig), up.mcap(tmp_path / "b", original().rig)
    one = read_recording(paths[0], topics=Topics(wrench_frame="tip"))
    other = read_recording(paths[1], topics=Topics(wrench_frame="tip", up="y"))
    # The tip's own axes are y up: along them the same numbers are another force.
    assert one.wrench is not None and other.wrench is not None
    rows, force = pose_rows(original().pusher)[:1], np.array([[one.wrench.fx[5], one.wrench.fy[5]]])
    tip = as_seen(rows, "y", True)[:, 3:]
    raw = np.array([[wrench().fx[5], wrench().fy[5], 0.0]])
    wanted = turned(turn_of("y")[:, 3:], turned(tip, raw))
    np.testing.assert_allclose([other.wrench.fx[5], other.wrench.fy[5]], wanted[0, :2], atol=1e-6)
    assert not np.allclose(wanted[0, :2], force)


@pytest.mark.parametrize("up", ["y", "-z"])
def test_a_sensor_known_to_tf_is_turned_with_the_world(tmp_path: Path, up: str) -> None:
    mounted, found = np.array([[0.02, -0.01, 0.05, 0.36, 0.48, 0.48, 0.64]]), []
    for axis in ("z", up):
        lab, whole = lab_with(axis, False, ("slider", "pusher")), original()
        stamps = whole.pusher.stamp[::10]
        lab.transform("/tf", "world", "ft", stamps, np.repeat(as_seen(mounted, axis, False), len(stamps), axis=0))
        path = lab.mcap(tmp_path / axis, whole.rig)
        found.append(read_recording(path, topics=Topics(wrench_frame="ft", up=axis)).wrench)
    plain, turned_world = found
    assert plain is not None and turned_world is not None and np.ptp(plain.fx) > 0.1
    for name in ("fx", "fy", "torque"):
        np.testing.assert_allclose(getattr(turned_world, name), getattr(plain, name), atol=1e-9)


# --- stamps -----------------------------------------------------------------------------------------------------------


def zero_stamps(*topics: str) -> Lab:
    """The original, where the headers of some topics have no stamp."""
    lab, whole = Lab(), original()
    for name, stream in (("slider", whole.slider), ("pusher", whole.pusher)):
        lab.pose(f"/{name}/pose", POSE, stream, "pose")
    assert whole.wrench is not None
    lab.wrench("/pusher/wrench", whole.wrench, WRENCH, "wrench")
    lab.messages = [(t, topic, blank(data) if topic in topics else data) for t, topic, data in lab.messages]
    return lab


def blank(data: bytes) -> bytes:
    """A message whose header has the stamp zero."""
    return data[:4] + bytes(8) + data[12:]


def assert_log_stamps(found: Recording) -> None:
    whole = original()
    assert found.wrench is not None and whole.wrench is not None and not found.losses
    pairs = ((found.slider, whole.slider), (found.pusher, whole.pusher), (found.wrench, whole.wrench))
    assert all(one.stamp.tolist() == (other.stamp + LATENCY).tolist() for one, other in pairs)
    assert found.slider.x.tolist() == whole.slider.x.tolist()


@pytest.mark.parametrize("topics", [("/slider/pose",), ("/slider/pose", "/pusher/pose", "/pusher/wrench"), ()])
def test_the_time_of_the_log_replaces_stamps_of_all_streams(tmp_path: Path, topics: tuple[str, ...]) -> None:
    path = zero_stamps(*topics).mcap(tmp_path / "lab", original().rig)
    assert_log_stamps(read_recording(path, topics=Topics(stamp="log")))
    assert (0 in read_recording(path).slider.stamp) is bool(topics)


def test_a_stamp_that_is_none_does_not_matter_with_the_time_of_the_log(tmp_path: Path) -> None:
    lab = zero_stamps()
    lab.messages = [(t, topic, data[:8] + b"\xff\xff\xff\xff" + data[12:]) for t, topic, data in lab.messages]
    path = lab.mcap(tmp_path / "lab", original().rig)
    assert_log_stamps(read_recording(path, topics=Topics(stamp="log")))
    with pytest.raises(RecordingError, match="no usable sample"):
        read_recording(path)


def test_transforms_have_the_time_of_the_log_as_well(tmp_path: Path) -> None:
    lab, whole = Lab(), short_recording(2.0)
    lab.transform("/tf", "world", "block", whole.slider.stamp, pose_rows(whole.slider))
    lab.messages = [(t, topic, data[:8] + bytes(8) + data[16:]) for t, topic, data in lab.messages]
    lab.pose("/pusher/pose", POSE, whole.pusher, "pose")
    found = read_recording(lab.mcap(tmp_path / "a.mcap"), topics=Topics("/tf:block", stamp="log"))
    assert np.diff(found.slider.stamp).tolist() == np.diff(whole.slider.stamp).tolist()
    assert abs(int(found.slider.stamp[0] - found.pusher.stamp[0])) < 50_000_000
    assert not read_recording(tmp_path / "a.mcap", topics=Topics("/tf:block")).slider.stamp.any()


def test_live_samples_have_the_time_of_receipt_not_that_of_sending() -> None:
    whole = short_recording(1.0)
    lab, later = zero_stamps("/slider/pose"), 5_000_000
    lab.transform("/tf", "world", "tip", whole.pusher.stamp, pose_rows(whole.pusher))
    decoder = decoder_of(lab, Topics(pusher="/tf:tip", stamp="log"))
    sent: dict[str, np.ndarray] = {}
    for topic in lab.kinds:
        own = [message for message in lab.in_order() if message[1] == topic]
        sent[topic] = np.array([time for time, *_ in own])
        decoder.put(Messages.of(topic, lab.kinds[topic], sent[topic], [data for *_, data in own]), sent[topic] + later)
    found = decoder.take(last=True)
    assert found.slider.stamp.tolist() == (sent["/slider/pose"] + later).tolist()
    assert found.pusher.stamp.tolist() == (sent["/tf"] + later).tolist()
