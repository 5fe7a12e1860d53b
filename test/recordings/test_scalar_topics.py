# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The value of a scalar topic at the start of a window is the same offline and online."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from decoding import input_of
from replay_bags import stamped
from synthetic import START, Push, feed, rows, square_rig, stamps, translating_push, wrench_rows

from push_predictor.nodes.validator.scalar_topics import DELAY, STALE, ClockHistory
from push_predictor.online import stream_health
from push_predictor.online.stream_health import StreamSync
from push_predictor.recordings.bag.message_types import POSE
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.streams import Recording, ScalarStream
from push_predictor.recordings.streams import taken as columns_taken
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import ScalarTrack, WindowFinder, find_windows
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array

SECOND = 10**9
WARMTH = "/warmth"


def stream(*samples: tuple[float, float]) -> ScalarStream:
    """(time s, value) pairs."""
    time, value = np.array(samples, dtype=np.float64).reshape(-1, 2).T
    return ScalarStream(stamps(time), value)


def track(*samples: tuple[float, float]) -> ScalarTrack:
    found = ScalarTrack()
    found.add(stream(*samples))
    return found


def at(found: ScalarTrack, time: float) -> float | None:
    return found.at(START + round(time * SECOND))


# --- one topic -------------------------------------------------------------------------------------------------------


def test_value_is_linear_between_samples_and_constant_beyond_them() -> None:
    warmth = track((1.0, 10.0), (2.0, 20.0), (4.0, 0.0))
    assert [at(warmth, time) for time in (0.0, 1.0, 1.25, 2.0, 3.5, 4.0, 90.0)] == [10, 10, 12.5, 20, 5, 0, 0]
    assert at(ScalarTrack(), 1.0) is None


def test_value_stays_constant_in_a_long_gap() -> None:
    warmth = track((0.0, 1.0), (5.0, 2.0), (10.1, 3.0))
    assert at(warmth, 2.5) == 1.5
    assert [at(warmth, time) for time in (5.1, 10.0)] == [2.0, 2.0]


def test_samples_without_increasing_stamp_are_discarded_and_counted() -> None:
    warmth = track((1.0, 1.0), (1.0, 5.0), (0.9, 6.0), (2.0, 2.0))
    warmth.add(stream((2.0, 7.0), (3.0, 3.0)))
    assert warmth.discarded == 3
    assert [at(warmth, time) for time in (1.0, 1.5, 2.5)] == [1.0, 1.5, 2.5]


def test_clock_set_back_restarts_the_topic() -> None:
    warmth = track((100.0, 1.0), (101.0, 2.0), (3.0, 7.0))
    assert at(warmth, 100.0) == 7.0 and not warmth.known_at(START + 4 * SECOND)
    warmth.add(stream((5.0, 9.0)))
    assert at(warmth, 4.0) == 8.0


def test_forgetting_old_samples_does_not_change_later_values() -> None:
    samples = [(0.1 * k, float(k % 7)) for k in range(100)]
    whole, part = track(*samples), track(*samples)
    part.forget_before(START + round(5.05 * SECOND))
    assert [at(part, time) for time in (5.05, 6.3, 20.0)] == [at(whole, time) for time in (5.05, 6.3, 20.0)]


# --- windows ---------------------------------------------------------------------------------------------------------


def with_warmth(scalar: ScalarStream) -> Recording:
    return replace(translating_push(), scalars={WARMTH: scalar})


def warmth_of(windows: list[PushWindow]) -> list[float | None]:
    return [window.covariates.get(f"topic:{WARMTH}") for window in windows]


def fed(recording: Recording, finder: WindowFinder, begin: float, end: float) -> None:
    """The sensors' samples from begin to end (s), without scalars."""
    feed(finder, recording, lambda of: part(of, begin, end))


def part(of: Any, begin: float, end: float) -> Any:
    return columns_taken(of, (of.stamp >= START + round(begin * SECOND)) & (of.stamp < START + round(end * SECOND)))


def noisy(rate: float, seed: int = 0) -> ScalarStream:
    time: Array = np.arange(0.0, 4.0, 1.0 / rate)
    return ScalarStream(stamps(time), np.random.default_rng(seed).standard_normal(len(time)))


@pytest.mark.parametrize(("late", "rate"), [(0.0, 40.0), (0.35, 1.3), (1.7, 40.0)])
def test_covariate_is_the_same_for_late_samples_in_portions(late: float, rate: float) -> None:
    recording = with_warmth(noisy(rate))
    expected, finder, found = find_windows(recording, square_rig()), WindowFinder(square_rig()), []
    assert len({*warmth_of(expected)}) == len(expected) > 3
    for time in np.arange(0.0, 6.0, 0.05):
        finder.add_scalar(WARMTH, part(recording.scalars[WARMTH], time - late, time - late + 0.05))
        fed(recording, finder, time, time + 0.05)
        found += finder.take_ready()
    found += finder.finish()
    assert [window.start for window in found] == [window.start for window in expected]
    assert warmth_of(found) == warmth_of(expected)


def test_window_waits_for_the_next_sample_for_a_limited_time() -> None:
    recording = replace(translating_push(Push(0.5, 1.6), tail=8.0), scalars={WARMTH: stream((0.0, 1.0))})
    finder, count = WindowFinder(square_rig()), len(find_windows(recording, square_rig()))
    finder.add_scalar(WARMTH, recording.scalars[WARMTH])
    fed(recording, finder, 0.0, 5.0)
    assert finder.take_ready() == []
    fed(recording, finder, 5.0, 8.0)
    windows = finder.take_ready()
    assert warmth_of(windows) == [1.0] * count and count > 3


def test_topic_without_samples_gives_no_covariate() -> None:
    recording, finder = translating_push(), WindowFinder(square_rig())
    finder.add_scalar(WARMTH, stream())
    fed(recording, finder, 0.0, 10.0)
    assert finder.take_ready() == []
    windows = finder.finish()
    assert windows and warmth_of(windows) == [None] * len(windows)


# --- messages --------------------------------------------------------------------------------------------------------


def tick(seconds: int, rest: int, order: str = "<") -> bytes:
    return bytes([0, order == "<", 0, 0]) + struct.pack(f"{order}iI", seconds, rest)


def test_message_gets_the_time_of_the_last_clock_message_before_it() -> None:
    times = ClockHistory()
    times.published = True
    times.put(tick(7, 5), 100)
    times.put(tick(8, 6, ">"), 200)
    assert [times.at(sent) for sent in (99, 100, 199, 200, 300)] == [
        None,
        7 * SECOND + 5,
        7 * SECOND + 5,
        *[8 * SECOND + 6] * 2,
    ]
    assert times.known_until(10 * SECOND) == 200


def test_without_a_clock_a_message_has_the_time_of_its_sending_once_none_can_come_any_more() -> None:
    times = ClockHistory()
    assert times.at(5) == 5 and times.known_until(10 * SECOND) == 10 * SECOND - DELAY


def test_the_time_of_a_clock_that_ended_expires() -> None:
    times = ClockHistory()
    times.put(tick(7, 5), 100)
    assert [times.at(sent) for sent in (99, 100 + STALE, 101 + STALE)] == [None, 7 * SECOND + 5, 101 + STALE]


def float64(value: float) -> bytes:
    return b"\0\1\0\0" + struct.pack("<d", value)


def decoder_of(text: str) -> tuple[StreamDecoder, TopicInput]:
    """A decoder of a scalar and poses; the scalar's input."""
    decoder = StreamDecoder(Topics(covariates=(text,)))
    for name in ("slider", "pusher"):
        decoder.inputs()[name].declare(POSE.name, {})
    return decoder, decoder.scalars[f"/{text.strip('/')}"]


def taken(text: str, kind: str, *messages: bytes) -> tuple[ScalarStream, TopicInput]:
    """The samples of messages of a scalar; its input."""
    decoder, own = decoder_of(text)
    input_of(own, kind, *messages)
    return decoder.take(last=True).scalars[f"/{text.strip('/')}"], own


def test_a_number_without_a_header_is_dated_by_its_sending() -> None:
    stream, own = taken("warmth", "std_msgs/msg/Float64", *map(float64, range(4)))
    assert (stream.stamp.tolist(), stream.value.tolist()) == ([0, 1, 2, 3], [0.0, 1.0, 2.0, 3.0])
    assert own.received == 4 and not own.timed


@pytest.mark.parametrize("kind", ["geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench"])
def test_a_field_of_another_type_has_the_stamp_of_its_header_or_the_time_of_its_sending(kind: str) -> None:
    field = "wrench.torque.y" if kind.endswith("Stamped") else "torque.y"
    numbers = [0.0, 0.0, 0.0, 0.0, 5.0, 0.0]
    timed = kind.endswith("Stamped")
    message = stamped(7 * SECOND, numbers) if timed else b"\0\1\0\0" + struct.pack("<6d", *numbers)
    stream, own = taken(f"/load.{field}", kind, message, b"\0\1", message)
    assert (stream.stamp.tolist(), stream.value.tolist()) == ([7 * SECOND] * 2 if timed else [0, 2], [5.0] * 2)
    assert dict(own.rejected) == {"unreadable": 1} and own.timed is timed


def test_samples_wait_for_the_first_pose_or_the_end() -> None:
    decoder, own = decoder_of("warmth")
    input_of(own, "std_msgs/msg/Float64", float64(1.0))
    assert decoder.take().scalars == {} and decoder.take_scalars() == {} and len(own) == 1
    assert decoder.take_scalars(last=True)["/warmth"].value.tolist() == [1.0]


def test_a_time_over_an_hour_from_the_poses_is_of_another_clock() -> None:
    decoder, own = decoder_of("load.wrench.torque.y")
    pose = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    for name, seconds in (("slider", 10_000), ("pusher", 10_005)):
        input_of(decoder.inputs()[name], POSE.name, stamped(seconds * SECOND, pose))
    hour = 3600
    seconds = [10_000 - hour - 1, 10_000 - hour + 6, 10_005 + hour - 6, 10_005 + hour + 1]
    loads = [stamped(second * SECOND, [0.0] * 6) for second in seconds]
    input_of(own, "geometry_msgs/msg/WrenchStamped", *loads)
    assert decoder.take().scalars["/load.wrench.torque.y"].stamp.tolist() == [s * SECOND for s in seconds[1:3]]
    assert dict(own.rejected) == {"another clock": 2}


def samples(recording: Recording, end: float, **named: float) -> Samples:
    """Sensors up to `end` s, each scalar with one sample at its time."""
    last = recording.slider.stamp < START + round(end * SECOND)
    none = wrench_rows(recording.wrench, np.arange(0)) if recording.wrench else None
    found = {f"/{name}": stream((time, 0.0)) for name, time in named.items()}
    return Samples(rows(recording.slider, last), rows(recording.pusher, last), none, found)


def test_late_scalar_is_waited_for_a_limited_time(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(stream_health, "monotonic", lambda: now[0])
    recording = translating_push(Push(0.5, 8.0))
    pace = StreamSync(["/warmth", "/absent"])
    pace.note(samples(recording, 1.0, warmth=0.9))
    assert not pace.in_step(), "/absent may only be late"
    now[0] += 5.1
    assert pace.in_step()
    pace.note(samples(recording, 6.0))
    assert not pace.in_step(), "/warmth is 5 s behind"
    pace.note(samples(recording, 6.0, warmth=5.0))
    assert pace.in_step()
    pace.note(samples(recording, 8.5))
    now[0] += 1.0
    assert not pace.in_step()
    now[0] += 4.1
    assert pace.in_step(), "it has ended"
