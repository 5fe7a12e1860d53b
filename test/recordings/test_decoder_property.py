# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Any portions and any order between topics give the samples and windows of a recording that is read at once.

Topics lag by less than the two seconds that the decoder allows. The bias of the wrench is that of the free motion so
far, so it is the same only where all messages come at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("rosbags")
from decoding import decoded, decoder_of, in_portions, put
from hypothesis import given
from hypothesis import strategies as st
from lab_bags import Lab, Message, pose_rows, pose_values
from synthetic import Push, moved, translating_push
from turning_sensor import MOUNT, add_wrench, in_sensor_axes, measured_at, wrench_rows

from push_predictor.recordings.decoder import transform_buffer
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised
from push_predictor.recordings.fields.wrench_bias import estimate_bias, with_planar_numbers
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.clock_session import free_motion
from push_predictor.recordings.windows.finder import WindowFinder, find_windows
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array

SECOND = 10**9
OWN = {
    "lab_msgs/msg/State": "string[] notes\nOdom odom\ngeometry_msgs/Wrench ft\n",
    "lab_msgs/msg/Odom": "std_msgs/Header header\nfloat64 age\ngeometry_msgs/PoseStamped pose\n",
}
# {how a pose is given: (type, where in it)}; `tf` is a frame.
TYPES = {
    "stamped": ("geometry_msgs/msg/PoseStamped", "pose"),
    "transform": ("geometry_msgs/msg/TransformStamped", "transform"),
    "odometry": ("nav_msgs/msg/Odometry", "pose.pose"),
    "covariance": ("geometry_msgs/msg/PoseWithCovarianceStamped", "pose.pose"),
    "field": ("lab_msgs/msg/State", "odom.pose.pose"),
}
KINDS = (*TYPES, "tf")
WRENCHES = {"stamped": "/ft", "field": "/state.ft", "none": "none"}
LAGS = st.sampled_from([0, SECOND // 50, SECOND // 3, 3 * SECOND // 2])
FRAMES = {"slider": "cart", "pusher": "bench"}  # that headers name where a world is given
BENCH = normalised(np.array([[0.3, -0.2, 0.1, 0.1, 0.0, 0.6, 0.8]]))
KEPT = 5 * SECOND // 2  # ns: less than the recording lasts


@cache
def original() -> Recording:
    """A push of 1.2 s, between motion without contact."""
    push = translating_push(Push(1.5, 2.7), rate=40.0)
    return moved(push, np.array([0.3, -0.1]), 0.7)


def rig() -> Rig:
    found = original().rig
    assert found is not None
    return found


def wrench() -> WrenchStream:
    found = original().wrench
    assert found is not None
    return found


def cart_at(stamp: Array) -> Array:
    """Poses (n, 7) of the cart in the world: it moves and turns."""
    seconds = 1e-9 * (stamp - original().slider.stamp[0])
    none = np.zeros(len(stamp))
    columns = [0.05 * seconds, 0.2 + none, none, none, none, np.sin(0.1 * seconds), np.cos(0.1 * seconds)]
    return np.column_stack(columns)


@cache
def laboratory() -> Lab:
    """Every pose as every type, in the world and in another frame; tf; wrenches along each axes; scalars."""
    lab, slider, pusher = Lab(OWN), original().slider, original().pusher
    late, early = np.arange(slider.stamp[4], slider.stamp[-9], SECOND // 30), pusher.stamp[:1]
    bench = np.repeat(BENCH, len(pusher), axis=0)
    in_frames = {
        "slider": composed(inverted(cart_at(slider.stamp)), pose_rows(slider)),
        "pusher": composed(inverted(bench), pose_rows(pusher)),
    }
    for name, stream in (("slider", slider), ("pusher", pusher)):
        for how in TYPES:
            add_poses(lab, f"/{name}/{how}/world", how, "world", stream.stamp, pose_rows(stream))
            add_poses(lab, f"/{name}/{how}/other", how, FRAMES[name], stream.stamp, in_frames[name])
    lab.transform("/tf_static", "world", "bench", early, BENCH)
    lab.transform("/tf_static", "tool0", "sensor", early, MOUNT)
    lab.transform("/tf", "world", "cart", late, cart_at(late))
    lab.transform("/tf", "cart", "block", slider.stamp, in_frames["slider"])
    lab.transform("/tf", "bench", "tool0", pusher.stamp, in_frames["pusher"])
    tip, values = pose_rows(pusher), wrench_rows(wrench())
    along = {"world": values, "tip": in_sensor_axes(values, tip), "sensor": measured_at(wrench(), tip)}
    for axes, measured in along.items():
        add_wrench(lab, f"/ft/{axes}", wrench().stamp, measured, "world" if axes == "world" else "sensor")
        rows = zip(measured.tolist(), strict=True)
        lab.add(f"/state/{axes}", "lab_msgs/msg/State", wrench().stamp, (
            {"notes": ["a"] * (number % 3), **{f"ft.{part}.{axis}": value for (part, axis), value in zip(
                ((part, axis) for part in ("force", "torque") for axis in "xyz"), row, strict=True)}}
            for number, (row,) in enumerate(rows)
        ))  # fmt: skip
    every = slider.stamp[::3]
    lab.add("/warmth", "std_msgs/msg/Float64", every, ({"data": float(k)} for k in range(len(every))))
    # The first and a later one are of another clock.
    times = np.where(np.isin(np.arange(len(every)), [0, 30]), every + 7200 * SECOND, every)
    lab.add("/rod", "sensor_msgs/msg/Temperature", every, (
        {**lab.header(at), "temperature": np.nan if k == 5 else float(k)} for k, at in enumerate(times.tolist())
    ))  # fmt: skip
    return damaged(lab)


def add_poses(lab: Lab, topic: str, how: str, frame: str, stamp: Array, rows: Array) -> None:
    kind, at = TYPES[how]
    names = ("translation", "rotation") if at == "transform" else ("position", "orientation")
    header = "odom.pose.header" if how == "field" else "header"
    notes = [{"notes": ["word" * (number % 4)]} if how == "field" else {} for number in range(len(rows))]
    lab.add(topic, kind, stamp, (
        {**lab.header(time, header), f"{header}.frame_id": frame, **pose_values(row, at, names), **more}
        for time, row, more in zip(stamp.tolist(), rows, notes, strict=True)
    ))  # fmt: skip


def damaged(lab: Lab) -> Lab:
    """The same with messages that cannot be read: the 20th and the 21st of each topic but /tf_static."""
    seen = dict.fromkeys(lab.kinds, 0)
    for place, (sent, topic, data) in enumerate(lab.messages):
        seen[topic] += 1
        if seen[topic] in (20, 21) and topic != "/tf_static":
            lab.messages[place] = (sent, topic, data[:12])
    return lab


@cache
def of_topic(topic: str) -> list[Message]:
    return sorted(message for message in laboratory().messages if message[1] == topic)


def topics_of(slider: str, pusher: str, world: bool, axes: str, force: str) -> Topics:
    """Topics of a combination; world: given, with poses in other frames."""
    named = {
        "slider": "/tf:block" if slider == "tf" else f"/slider/{slider}/{'other' if world else 'world'}",
        "pusher": "/tf:tool0" if pusher == "tf" else f"/pusher/{pusher}/{'other' if world else 'world'}",
    }
    for name, how in (("slider", slider), ("pusher", pusher)):
        named[name] += ".odom.pose.pose" if how == "field" else ""
    place, _, field = WRENCHES[force].partition(".")
    given = force if force == "none" else f"{place}/{axes}" + (f".{field}" if field else "")
    return Topics(**named, wrench=given, covariates=("/warmth", "/rod"), world="world" if world else "",
                  wrench_frame=axes)  # fmt: skip


def in_order(topics: Topics, lags: Sequence[int]) -> list[Message]:
    """The messages that a decoder of these topics is given, each topic behind by its lag (ns); /tf_static comes first.

    Log times stay as they are.
    """
    given = (topics.slider, topics.pusher, topics.wrench, *topics.covariates)
    names = dict.fromkeys(["/tf", *(text.partition(":")[0].partition(".")[0] for text in given)])
    behind = dict(zip(names, lags, strict=False))
    messages = [m for name in names if name in laboratory().kinds for m in of_topic(name)]
    return [*of_topic("/tf_static"), *sorted(messages, key=lambda message: message[0] + behind[message[1]])]


def at_once(topics: Topics) -> tuple[StreamDecoder, Samples]:
    """A decoder that is given all messages in one portion, and its samples."""
    decoder = decoder_of(laboratory(), topics, rig=rig())
    put(decoder, laboratory(), in_order(topics, [0] * 9))
    return decoder, decoder.take(last=True)


def assert_same_samples(found: Samples, wanted: Samples) -> None:
    pairs = [(getattr(found, name), getattr(wanted, name)) for name in ("slider", "pusher", "wrench")]
    assert found.scalars.keys() == wanted.scalars.keys()
    for one, other in [*pairs, *((found.scalars[name], wanted.scalars[name]) for name in wanted.scalars)]:
        assert np.array_equal(one.stamp, other.stamp)
        for column in vars(other):
            np.testing.assert_allclose(getattr(one, column), getattr(other, column), rtol=0.0, atol=1e-12)


def windows_of(samples: Samples) -> list[PushWindow]:
    parts = {"slider": samples.slider, "pusher": samples.pusher, "wrench": samples.wrench}
    return find_windows(Recording("some", rig(), **parts, scalars=samples.scalars), rig())


def assert_same_windows(found: list[PushWindow], wanted: list[PushWindow]) -> None:
    assert [(w.start, w.end, w.push_id) for w in found] == [(w.start, w.end, w.push_id) for w in wanted]
    for one, other in zip(found, wanted, strict=True):
        assert [one.velocity, one.contact, one.angle, *one.displacement] == pytest.approx(
            [other.velocity, other.contact, other.angle, *other.displacement], abs=1e-9
        )
        assert one.covariates == pytest.approx(other.covariates, abs=1e-9)


def portions_of(messages: list[Message], cuts: list[float]) -> list[Sequence[Message]]:
    ends = [0, *sorted(round(cut * len(messages)) for cut in cuts), len(messages)]
    return [messages[begin:end] for begin, end in pairwise(ends)]


COMBINATIONS = st.builds(
    topics_of,
    st.sampled_from(KINDS),
    st.sampled_from(KINDS),
    st.booleans(),
    st.sampled_from(["world", "tip", "sensor"]),
    st.sampled_from(list(WRENCHES)),
)


@pytest.fixture(autouse=True)
def short_memory() -> object:
    """Transforms are forgotten within the recording."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(transform_buffer, "KEPT", KEPT)
        yield


@pytest.mark.parametrize(("world", "axes"), [(False, "world"), (True, "tip"), (True, "sensor")])
@pytest.mark.parametrize("how", KINDS)
def test_every_type_and_frame_gives_the_original_streams(how: str, world: bool, axes: str) -> None:
    decoder, samples = at_once(topics_of(how, how, world, axes, "stamped"))
    for name in ("slider", "pusher"):
        found, wanted = getattr(samples, name), getattr(original(), name)
        kept = np.isin(wanted.stamp, found.stamp)
        assert len(found) == kept.sum() and len(found) > len(wanted) - 20
        for column in ("x", "y", "heading"):
            np.testing.assert_allclose(getattr(found, column), getattr(wanted, column)[kept], atol=2e-5)
    kept = np.isin(wrench().stamp, samples.wrench.stamp)
    assert len(samples.wrench) == kept.sum() and len(samples.wrench) > len(wrench()) - 20
    for column in ("fx", "fy", "torque"):
        np.testing.assert_allclose(getattr(samples.wrench, column), getattr(wrench(), column)[kept], atol=1e-6)
    assert dict(decoder.scalars["/rod"].rejected) == {"unreadable": 2, "not finite": 1, "another clock": 2}
    assert len(windows_of(samples)) > 2


@given(COMBINATIONS, st.lists(LAGS, min_size=6, max_size=6), st.lists(st.floats(0.0, 1.0), max_size=12))
def test_portions_and_order_of_topics_change_no_sample_and_no_window(
    topics: Topics, lags: list[int], cuts: list[float]
) -> None:
    whole, wanted = at_once(topics)
    split, messages = decoder_of(laboratory(), topics, rig=rig()), in_order(topics, lags)
    found = decoded(split, laboratory(), portions_of(messages, cuts), live=True)
    assert_same_samples(found, wanted)
    for name in ("slider", "pusher", "wrench"):
        assert split.of(name).rejected == whole.of(name).rejected and split.of(name).received == whole.of(name).received
    for name, each in whole.scalars.items():
        assert split.scalars[name].rejected == each.rejected
    assert (split.wrench.without_pose, split.headless) == (whole.wrench.without_pose, whole.headless)
    assert_same_windows(windows_of(found), windows_of(wanted))


@pytest.mark.parametrize("topics", [topics_of("transform", "tf", True, "sensor", "stamped"),
                                    topics_of("tf", "field", False, "tip", "field")])  # fmt: skip
def test_small_portions_through_the_finder_give_the_windows_of_the_whole(topics: Topics) -> None:
    decoder, finder = decoder_of(laboratory(), topics, rig=rig()), WindowFinder(rig())
    windows: list[PushWindow] = []
    messages = in_order(topics, [SECOND, 0, SECOND // 3, SECOND // 2, 0, 0])
    for number, portion in enumerate([*in_portions(messages, 12), []]):
        put(decoder, laboratory(), portion, live=True)
        samples = decoder.take(last=not portion)
        finder.add_wrench(samples.wrench)
        finder.add_pusher(samples.pusher)
        finder.add_slider(samples.slider)
        for name, stream in samples.scalars.items():
            finder.add_scalar(name, stream)
        windows += finder.take_ready() if number % 4 == 0 else []
    assert_same_windows([*windows, *finder.finish()], windows_of(at_once(topics)[1]))


@pytest.mark.parametrize("axes", ["world", "tip", "sensor"])
def test_the_bias_of_one_portion_is_that_of_the_free_motion(axes: str) -> None:
    topics = topics_of("stamped", "stamped", False, axes, "stamped")
    decoder, samples = at_once(replace(topics, wrench_bias="free_motion"))
    raw = [message for message in of_topic(f"/ft/{axes}") if len(message[2]) > 40]
    numbers = np.array([np.frombuffer(data[-48:]) for *_, data in raw])
    stamp = wrench().stamp[~np.isin(np.arange(len(wrench())), [19, 20])]
    tip = pose_rows(original().pusher)
    sensor = {"world": None, "tip": tip, "sensor": composed(tip, np.repeat(MOUNT, len(tip), axis=0))}[axes]
    kept = np.isin(stamp, samples.wrench.stamp)
    free = free_motion(rig(), samples.slider, samples.pusher, stamp[kept])
    axes_at = None if sensor is None else sensor[np.isin(wrench().stamp, stamp[kept])]
    values = numbers[kept] if axes_at is not None else with_planar_numbers(numbers[kept])
    wanted = estimate_bias(stamp[kept], values, free, axes_at)
    found = decoder.wrench.estimate
    assert found is not None
    assert [*found.force, *found.torque] == pytest.approx([*wanted.force, *wanted.torque], abs=1e-6)
