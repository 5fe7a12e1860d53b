# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Any portions and any order between topics give the samples and windows of a recording that is read at once.

Topics lag by less than the two seconds that the decoder allows. The bias of the wrench is that of the free motion so
far, so it is the same only where all messages come at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("rosbags")
from decoding import decoded, decoder_of, in_portions, put
from every_stream import (
    AGE,
    COUNTS,
    KINDS,
    NUMBER,
    SCALARS,
    SECOND,
    TYPES,
    WRENCHES,
    by_topic,
    in_order,
    laboratory,
    original,
    rig,
    topics_of,
    wrench,
)
from hypothesis import given
from hypothesis import strategies as st
from lab_bags import Message, pose_rows
from turning_sensor import MOUNT

from push_predictor.recordings.decoder import transform_buffer
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder
from push_predictor.recordings.fields.pose_rows import composed
from push_predictor.recordings.fields.wrench_bias import estimate_bias, with_planar_numbers
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.clock_session import free_motion
from push_predictor.recordings.windows.finder import WindowFinder, find_windows
from push_predictor.recordings.windows.push_window import PushWindow

LAGS = st.sampled_from([0, SECOND // 50, SECOND // 3, 3 * SECOND // 2])
KEPT = 5 * SECOND // 2  # ns: less than the recording lasts
BACK = 100 * SECOND
UNBIASED = [force for force in WRENCHES if force != "biased"]


def up_in(topics: Topics) -> str:
    """The laboratory that has these topics."""
    return topics.up[:1]


def at_once(topics: Topics, back: int = 0) -> tuple[StreamDecoder, Samples]:
    """A decoder that is given all messages in one portion, and its samples."""
    up = up_in(topics)
    decoder = decoder_of(laboratory(up, back), topics, rig=rig())
    put(decoder, laboratory(up, back), in_order(topics, [], up, back))
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
    st.sampled_from([*UNBIASED, "none"]),
    st.sampled_from(["", "y"]),
    st.sampled_from(["", "log"]),
)
FROM_TOPICS = st.builds(
    topics_of,
    st.sampled_from([*TYPES]),
    st.sampled_from([*TYPES]),
    st.just(False),
    st.sampled_from(["world", "tip"]),
    st.sampled_from([*UNBIASED, "none"]),
)
CUTS = st.lists(st.floats(0.0, 1.0), max_size=12)


@pytest.fixture(autouse=True)
def short_memory() -> object:
    """Transforms are forgotten within the recording."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(transform_buffer, "KEPT", KEPT)
        yield


@pytest.mark.parametrize(("world", "axes", "up"), [(False, "world", "y"), (True, "tip", ""), (True, "sensor", "y")])
@pytest.mark.parametrize(("how", "force"), [*((how, "stamped") for how in KINDS),
                                            *(("stamped", force) for force in UNBIASED)])  # fmt: skip
def test_every_type_and_frame_gives_the_original_streams(how: str, force: str, world: bool, axes: str, up: str) -> None:
    decoder, samples = at_once(topics_of(how, how, world, axes, force, up))
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
    assert_scalars(decoder, samples)
    assert len(windows_of(samples)) > 2


def assert_scalars(decoder: StreamDecoder, samples: Samples) -> None:
    """Every third slider pose numbers its scalars, every wrench the one in its message, every pose of a body has 7."""
    faults = {"unreadable": 2, "not finite": 1}
    for topic, (kind, _) in SCALARS.items():
        headed = kind.startswith("sensor_msgs")
        assert dict(decoder.scalars[topic].rejected) == faults | ({"another clock": 2} if headed else {})
        without = {5, 19, 20, *((0, 30) if headed else ())}
        assert samples.scalars[topic].value.tolist() == [k for k in range(47) if k not in without]
    assert samples.scalars[COUNTS].value.tolist() == [k for k in range(47) if k not in (19, 20)]
    assert samples.scalars[AGE].value.tolist() == [k for k in range(len(wrench())) if k not in (19, 20)]
    assert {*samples.scalars[NUMBER].value.tolist()} == {7.0}
    lacks = decoder.scalars[NUMBER]
    assert dict(lacks.rejected) == {"without element": -(-len(original().slider) // 29), "unreadable": 2}
    assert np.isin(samples.scalars[AGE].stamp, wrench().stamp).all()


@given(COMBINATIONS, st.lists(LAGS, min_size=12, max_size=12), CUTS)
def test_portions_and_order_of_topics_change_no_sample_and_no_window(
    topics: Topics, lags: list[int], cuts: list[float]
) -> None:
    assert_portions_do_not_matter(topics, lags, cuts)


@given(FROM_TOPICS, CUTS)
def test_portions_change_nothing_where_the_clock_is_set_back(topics: Topics, cuts: list[float]) -> None:
    """Of transforms only the time after that is kept, and of wrenches that come after the tip's new time."""
    _, wanted = assert_portions_do_not_matter(topics, [], cuts, BACK)
    headed = not topics.slider.startswith("/slider/plain")
    assert int(np.sum(np.diff(wanted.slider.stamp) < -BACK // 2)) == headed


def assert_portions_do_not_matter(
    topics: Topics, lags: list[int], cuts: list[float], back: int = 0
) -> tuple[Samples, Samples]:
    """Assert that samples, counts and windows are those of one portion; the samples of both."""
    up = up_in(topics)
    whole, wanted = at_once(topics, back)
    split, messages = decoder_of(laboratory(up, back), topics, rig=rig()), in_order(topics, lags, up, back)
    found = decoded(split, laboratory(up, back), portions_of(messages, cuts), live=True)
    assert_same_samples(found, wanted)
    for name in ("slider", "pusher", "wrench"):
        assert split.of(name).rejected == whole.of(name).rejected and split.of(name).received == whole.of(name).received
    for name, each in whole.scalars.items():
        assert split.scalars[name].rejected == each.rejected
    assert (split.wrench.without_pose, split.headless) == (whole.wrench.without_pose, whole.headless)
    assert_same_windows(windows_of(found), windows_of(wanted))
    return found, wanted


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
    raw = [message for message in by_topic()[f"/ft/stamped/{axes}"] if len(message[2]) > 40]
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


BIASED = st.builds(
    topics_of,
    *(st.sampled_from(["stamped", "tf", "named"]) for _ in ("slider", "pusher")),
    st.just(False),
    st.sampled_from(["world", "tip", "sensor"]),
    st.just("biased"),
)


@given(BIASED, st.lists(LAGS, min_size=12, max_size=12), CUTS)
def test_the_bias_in_portions_is_subtracted_from_every_wrench(
    topics: Topics, lags: list[int], cuts: list[float]
) -> None:
    """Without noise any free motion gives the same bias."""
    topics = replace(topics, wrench_bias="free_motion")
    whole, wanted = at_once(topics)
    split, messages = decoder_of(laboratory(), topics, rig=rig()), in_order(topics, lags)
    found = decoded(split, laboratory(), portions_of(messages, cuts), live=True)
    assert len(wanted.wrench) > 100 and np.array_equal(found.wrench.stamp, wanted.wrench.stamp)
    assert whole.wrench.estimate is not None and split.wrench.estimate is not None
    for name in ("force", "torque"):
        one, other = (getattr(each.wrench.estimate, name) for each in (split, whole))
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-6)
    kept = np.isin(wrench().stamp, found.wrench.stamp)
    for column in ("fx", "fy", "torque"):
        for samples in (found, wanted):
            np.testing.assert_allclose(getattr(samples.wrench, column), getattr(wrench(), column)[kept], atol=1e-6)
    assert not split.wrench.waits_for_bias
