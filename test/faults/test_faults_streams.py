# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of streams as they occur in a lab: they are counted by kind and give no wrong window."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from lab_bags import short_recording
from synthetic import START, Push, feed, translating_push

from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream, taken
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.recordings.windows.stamp_order import LOOKAHEAD
from push_predictor.recordings.windows.stream_faults import (
    CLOCK_TOLERANCE,
    FAULTS,
    clock_offset,
    describe_recording_faults,
)
from push_predictor.types import Array

pytestmark = pytest.mark.slow

Stream = PoseStream | WrenchStream
SECOND, DAY = 10**9, 86_400 * 10**9
PERIOD = 25_000_000  # ns, the longest of all streams
PLACES = st.floats(0.02, 0.98)
SENSORS = ("slider", "pusher", "wrench")
EXAMPLES = int(os.environ.get("FAULT_EXAMPLES", "8"))
OFTEN = settings(max_examples=EXAMPLES, deadline=None, phases=(Phase.explicit, Phase.reuse, Phase.generate))


def found_in(recording: Recording) -> tuple[list[PushWindow], dict[str, int]]:
    finder = WindowFinder(recording.rig)
    windows = finder.find(recording)
    return windows, finder.counts


@dataclass(frozen=True)
class Clean:
    recording: Recording
    windows: list[PushWindow]


def clean(recording: Recording) -> Clean:
    return Clean(recording, found_in(recording)[0])


MADE_UP = clean(translating_push(Push(0.5, 3.0)))
FORCELESS = clean(replace(MADE_UP.recording, wrench=None))
MEASURED = clean(short_recording(10.0))  # with the noise and the resets of a rig
CLEAN = {"made up": MADE_UP, "no wrench": FORCELESS, "measured": MEASURED}
any_clean = st.sampled_from(list(CLEAN))
with_wrench = st.sampled_from(["made up", "measured"])


def test_clean_recordings_have_windows() -> None:
    assert [len(c.windows) for c in CLEAN.values()] >= [12, 12, 10]
    assert max(np.hypot(*w.displacement[:2]) for c in CLEAN.values() for w in c.windows) > 0.003


# --- correct windows -------------------------------------------------------------------------------------------------


def numbers(window: PushWindow) -> list[float]:
    return [window.velocity, window.contact, window.angle, window.duration, *window.displacement]


def at(stream: PoseStream, stamps: Sequence[int]) -> Array:
    """x, y, heading at stamps, from the samples around them."""
    columns = (stream.x, stream.y, np.unwrap(stream.heading))
    return np.column_stack([np.interp(np.array(stamps) - START, stream.stamp - START, column) for column in columns])


def assert_true(windows: Sequence[PushWindow], truth: Clean, damaged: Sequence[tuple[int, int]], late: int = 0) -> None:
    """Each window is one of the clean recording, or lies away from the fault; all agree with the clean recording.

    damaged: from and to (ns). late: by how much (ns) the true time is ahead of the stamps.
    """
    known = {(w.start, w.end): w for w in truth.windows}
    for window in windows:
        same = known.get((window.start + late, window.end + late))
        if same is not None and numbers(window) == pytest.approx(numbers(same), rel=0.0, abs=1e-9):
            continue
        touched = [d for d in damaged if window.start <= d[1] and d[0] <= window.end]
        assert not touched, f"{window} spans {touched}"
        ends = [window.start + late, window.end + late]
        before, after = at(truth.recording.slider, ends)
        moved, turned = window.displacement[:2], window.displacement[2]
        assert np.hypot(*moved) == pytest.approx(np.hypot(*(after - before)[:2]), abs=1e-6)
        assert turned == pytest.approx(after[2] - before[2], abs=1e-6)
        tip = at(truth.recording.pusher, ends)[:, :2]
        assert np.hypot(*moved) < 1.25 * np.hypot(*(tip[1] - tip[0])) + 0.002


def place_in(stream: Stream, share: float, count: int = 1) -> int:
    return int(share * (len(stream) - count - 1)) + 1


# --- discarded samples -----------------------------------------------------------------------------------------------


@OFTEN
@given(which=with_wrench, name=st.sampled_from(SENSORS), share=PLACES, back=st.integers(2, 60))
def test_late_sample_is_discarded_and_counted(which: str, name: str, share: float, back: int) -> None:
    truth, stream = CLEAN[which], getattr(CLEAN[which].recording, name)
    place = min(place_in(stream, share), len(stream) - back - 8)
    order = np.r_[0:place, place + 1 : place + back + 1, place, place + back + 1 : len(stream)]
    windows, counts = found_in(replace(truth.recording, **{name: taken(stream, order)}))
    assert (counts["late"], counts[f"{name} late"], counts["refused"]) == (1, 1, 1)
    assert_is_as_without(windows, truth, name, [place])


@OFTEN
@given(which=with_wrench, name=st.sampled_from(SENSORS), share=PLACES, count=st.integers(1, 40))
def test_repeated_samples_are_used_once(which: str, name: str, share: float, count: int) -> None:
    truth, stream = CLEAN[which], getattr(CLEAN[which].recording, name)
    place = place_in(stream, share, count)
    order = np.r_[0 : place + count, place : len(stream)]
    windows, counts = found_in(replace(truth.recording, **{name: taken(stream, order)}))
    assert (counts["repeated"], counts[f"{name} repeated"]) == (count, count)
    assert list(map(numbers, windows)) == list(map(numbers, truth.windows))


@OFTEN
@given(
    which=with_wrench,
    name=st.sampled_from(SENSORS),
    share=PLACES,
    count=st.integers(1, 3),
    ahead=st.sampled_from([5 * PERIOD, SECOND, 30 * SECOND, DAY, 3650 * DAY]),
)
@example(which="made up", name="wrench", share=0.1266, count=3, ahead=5 * PERIOD)  # the force's last zeros are missing
def test_future_stamp_discards_only_its_sample(which: str, name: str, share: float, count: int, ahead: int) -> None:
    truth, stream = CLEAN[which], getattr(CLEAN[which].recording, name)
    place = place_in(stream, share, 12)
    stamp = stream.stamp.copy()
    stamp[place : place + count] += ahead
    windows, counts = found_in(replace(truth.recording, **{name: replace(stream, stamp=stamp)}))
    assert (counts["ahead"], counts[f"{name} ahead"], counts["clock_set_back"]) == (count, count, 0)
    assert_is_as_without(windows, truth, name, range(place, place + count))


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("stamp", [0, START - 3 * DAY, START + 3 * DAY])
def test_isolated_first_or_last_stamp_is_discarded(name: str, stamp: int) -> None:
    stream = getattr(MADE_UP.recording, name)
    for place in (0, len(stream) - 1):
        stamps = stream.stamp.copy()
        stamps[place] = stamp
        windows, counts = found_in(replace(MADE_UP.recording, **{name: replace(stream, stamp=stamps)}))
        assert counts["refused"] == 1 and counts["clock_set_back"] == 0
        assert list(map(numbers, windows)) == [pytest.approx(numbers(w), abs=1e-9) for w in MADE_UP.windows]


def repositioned(stream: PoseStream, place: int, count: int) -> bool:
    """Whether the slider is carried faster than 0.85 m/s near some samples.

    No push is that fast. A jump of 3 cm may then look like a motion, and the motion itself like a jump.
    """
    near = slice(max(0, place - LOOKAHEAD), place + count + LOOKAHEAD)
    elapsed = 1e-9 * np.diff(stream.stamp[near])
    return bool(np.any(np.hypot(np.diff(stream.x[near]), np.diff(stream.y[near])) > 0.85 * elapsed))


@OFTEN
@given(
    which=any_clean,
    name=st.sampled_from(["slider", "pusher"]),
    share=PLACES,
    count=st.integers(1, 3),
    jump=st.floats(0.03, 2.0),
    direction=st.floats(-3.2, 3.2),
)
@example(which="measured", name="pusher", share=0.49, count=3, jump=1.8, direction=2.3)  # a tip at 0.7 m/s
def test_jump_away_and_back_discards_only_the_samples_away(
    which: str, name: str, share: float, count: int, jump: float, direction: float
) -> None:
    truth, stream = CLEAN[which], getattr(CLEAN[which].recording, name)
    place = place_in(stream, share, 12)
    x, y = stream.x.copy(), stream.y.copy()
    x[place : place + count] += jump * np.cos(direction)
    y[place : place + count] += jump * np.sin(direction)
    windows, counts = found_in(replace(truth.recording, **{name: replace(stream, x=x, y=y)}))
    if not repositioned(stream, place, count):
        assert counts[f"{name} jumps"] == count
    assert_is_as_without(windows, truth, name, range(place, place + count))


@OFTEN
@given(which=with_wrench, name=st.sampled_from(SENSORS), share=PLACES, count=st.integers(1, 3))
def test_nan_or_infinity_discards_only_its_sample(which: str, name: str, share: float, count: int) -> None:
    truth, stream = CLEAN[which], getattr(CLEAN[which].recording, name)
    place, column = place_in(stream, share, count), "fx" if name == "wrench" else "x"
    values = getattr(stream, column).copy()
    values[place : place + count] = np.nan
    windows, counts = found_in(replace(truth.recording, **{name: replace(stream, **{column: values})}))
    assert (counts["not_finite"], counts[f"{name} not_finite"]) == (count, count)
    assert_is_as_without(windows, truth, name, range(place, place + count))


def assert_is_as_without(windows: list[PushWindow], truth: Clean, name: str, places: Sequence[int]) -> None:
    """The windows equal those of the recording without some samples, and are correct."""
    stream = getattr(truth.recording, name)
    left, _ = found_in(replace(truth.recording, **{name: taken(stream, np.delete(np.arange(len(stream)), places))}))
    assert [(w.push_id, w.start) for w in windows] == [(w.push_id, w.start) for w in left]
    for found, expected in zip(windows, left, strict=True):
        assert numbers(found) == pytest.approx(numbers(expected), rel=0.0, abs=1e-9)
    if truth is not MEASURED:  # straight lines: interpolation is exact
        stamps = stream.stamp[list(places)].tolist()
        assert_true(windows, truth, [(stamp, stamp) for stamp in stamps])


# --- faults that interrupt a push ------------------------------------------------------------------------------------


@OFTEN
@given(which=any_clean, name=st.sampled_from(SENSORS), share=PLACES, length=st.floats(0.13, 1.9))
def test_no_window_spans_a_dropout_of_any_stream(which: str, name: str, share: float, length: float) -> None:
    """Up to 2 s: a wrench that is missing for longer counts as none."""
    truth = CLEAN[which]
    if truth.recording.wrench is None and name == "wrench":
        return
    stream = getattr(truth.recording, name)
    begin = stream.stamp[place_in(stream, share)]
    gone = (stream.stamp > begin) & (stream.stamp < begin + length * SECOND)
    windows, counts = found_in(replace(truth.recording, **{name: taken(stream, ~gone)}))
    after = stream.stamp[~gone & (stream.stamp > begin)]
    if len(after) > 1:
        assert counts[f"{name} dropouts"] >= 1
    elif len(after):  # a single sample may as well have a wrong stamp
        assert counts.get(f"{name} dropouts", 0) + counts.get(f"{name} ahead", 0) >= 1
    stopped = name == "wrench" and not len(after)  # windows come from the geometry then
    inside = (int(begin) + 1, int(after[0]) - 1 if len(after) else int(stream.stamp[-1]) + DAY)
    assert_true(windows, truth, [] if stopped else [inside])


@OFTEN
@given(
    which=any_clean,
    share=PLACES,
    jump=st.floats(0.03, 0.5),
    direction=st.floats(-3.2, 3.2),
    unseen=st.sampled_from([0.0, 0.1, 0.5]),
    tip_too=st.booleans(),
)
def test_reset_during_a_push_ends_it(
    which: str, share: float, jump: float, direction: float, unseen: float, tip_too: bool
) -> None:
    truth = CLEAN[which]
    slider, pusher = truth.recording.slider, truth.recording.pusher
    begin = int(slider.stamp[place_in(slider, share)])
    end = begin + round(unseen * SECOND)

    def put(stream: PoseStream) -> PoseStream:
        late = stream.stamp > begin
        x, y = stream.x + jump * np.cos(direction) * late, stream.y + jump * np.sin(direction) * late
        return taken(replace(stream, x=x, y=y), (stream.stamp <= begin) | (stream.stamp > end))

    reset = replace(truth.recording, slider=put(slider), pusher=put(pusher) if tip_too else pusher)
    windows, counts = found_in(reset)
    after = int(min(reset.slider.stamp[reset.slider.stamp > begin], default=begin + DAY))
    hidden = (pusher.stamp > begin) & (pusher.stamp < after)
    pushed = np.hypot(np.ptp(pusher.x[hidden]), np.ptp(pusher.y[hidden])) if hidden.any() else 0.0
    moved = step_over(reset.slider, begin)
    may_be_pushed = bool(unseen) and (tip_too or pushed > moved)
    if after < begin + DAY and not may_be_pushed:
        assert counts["resets"] >= 1
    assert all(w.end <= begin + 1 or w.start >= after for w in windows)
    if tip_too:
        assert_true(windows, truth, [(begin + 1, after - 1)])
    ids = [{w.push_id for w in windows if w.end <= begin}, {w.push_id for w in windows if w.start >= after}]
    assert not ids[0] & ids[1] or may_be_pushed


def step_over(stream: PoseStream, stamp: int) -> float:
    """How far the body is after a stamp from where it was before, m: the jump, and its motion meanwhile."""
    after = min(int(np.searchsorted(stream.stamp, stamp, side="right")), len(stream) - 1)
    before = max(after - 1, 0)
    return float(np.hypot(stream.x[after] - stream.x[before], stream.y[after] - stream.y[before]))


@OFTEN
@given(which=any_clean, share=PLACES, jump=st.floats(0.03, 0.5), direction=st.floats(-3.2, 3.2))
def test_no_window_spans_a_lasting_jump_of_the_tip(which: str, share: float, jump: float, direction: float) -> None:
    truth = CLEAN[which]
    pusher = truth.recording.pusher
    place = place_in(pusher, share)
    late = np.arange(len(pusher)) > place
    moved = replace(pusher, x=pusher.x + jump * np.cos(direction) * late, y=pusher.y + jump * np.sin(direction) * late)
    windows, counts = found_in(replace(truth.recording, pusher=moved))
    assert counts["pusher jumps"] >= 1
    stamps = pusher.stamp[[place, place + 1]].tolist()
    assert all(w.end <= stamps[1] or w.start >= stamps[0] for w in windows)
    assert_true([w for w in windows if w.end <= stamps[0]], truth, [])


@OFTEN
@given(which=any_clean, share=PLACES, step=st.floats(0.1, 0.9))
def test_no_window_spans_a_clock_set_back_by_less_than_a_second(which: str, share: float, step: float) -> None:
    truth = CLEAN[which]
    when = int(truth.recording.slider.stamp[place_in(truth.recording.slider, share)])
    back = round(step * SECOND) + 1_234_567  # no stamp is repeated
    names = [name for name in SENSORS if getattr(truth.recording, name) is not None]

    def put_back(stream: Stream) -> Stream:
        return replace(stream, stamp=np.where(stream.stamp > when, stream.stamp - back, stream.stamp))

    windows, counts = found_in(
        replace(truth.recording, **{name: put_back(getattr(truth.recording, name)) for name in names})
    )
    if when < truth.recording.slider.stamp[-1] - 2 * SECOND:
        assert counts["slider late"] >= 8
    assert_true([w for w in windows if w.end <= when], truth, [])
    assert_true([w for w in windows if w.end > when], truth, [(when - back, when)], late=back)


# --- clocks ----------------------------------------------------------------------------------------------------------


@OFTEN
@given(which=any_clean, lag=st.floats(0.3, 8.0), sign=st.sampled_from([-1, 1]), force_too=st.booleans())
def test_clock_offset_of_the_pusher_gives_no_wrong_window_and_is_reported(
    which: str, lag: float, sign: int, force_too: bool
) -> None:
    recording, shift = CLEAN[which].recording, sign * round(lag * SECOND)
    shifted = replace(recording, pusher=replace(recording.pusher, stamp=recording.pusher.stamp + shift))
    if force_too and recording.wrench is not None:
        shifted = replace(shifted, wrench=replace(recording.wrench, stamp=recording.wrench.stamp + shift))
    windows, counts = found_in(shifted)
    assert clock_offset(shifted.pusher, shifted.slider) == pytest.approx(sign * lag, abs=0.05)
    ahead = "ahead of" if sign > 0 else "behind"
    assert any(f"{ahead} those of the slider" in text for text in describe_recording_faults(shifted, counts))
    for window in windows:
        tip = at(shifted.pusher, [window.start, window.end])[:, :2]
        driven, moved = np.hypot(*(tip[1] - tip[0])), np.hypot(*window.displacement[:2])
        assert 0.25 * driven - 0.001 < moved < 1.25 * driven + 0.002, "the slider did not move with the tip"
    if which != "measured":
        assert windows == []


@pytest.mark.parametrize("lag", [0.2, 0.4, 1.0])
def test_tip_that_enters_the_outline_gives_no_window(lag: float) -> None:
    recording, shift = translating_push(Push(2.0, 4.0)), round(lag * SECOND)
    early = {
        name: replace(getattr(recording, name), stamp=getattr(recording, name).stamp - shift) for name in SENSORS[1:]
    }
    windows, counts = found_in(replace(recording, **early))
    assert all(w.displacement[0] > 0.003 for w in windows), "the tip drove 4 mm in each"
    assert counts["left_behind"] >= 1 and (lag < 0.3 or windows == [])
    assert counts["inside"] == (lag > 0.3)


def test_clocks_of_a_sound_recording_have_no_offset() -> None:
    for truth in CLEAN.values():
        assert abs(clock_offset(truth.recording.pusher, truth.recording.slider)) < CLOCK_TOLERANCE
        words = describe_recording_faults(truth.recording, found_in(truth.recording)[1])
        assert words == ["no wrench was recorded: contact is found from geometry alone"] * (truth is FORCELESS)


@OFTEN
@given(
    which=any_clean,
    cut=st.floats(0.3, 1.0),
    to=st.floats(0.0, 0.25),
    portion=st.integers(1, 90),
    order=st.permutations(SENSORS),
)
def test_clock_set_back_keeps_the_windows_of_both_times(
    which: str, cut: float, to: float, portion: int, order: list[str]
) -> None:
    """As after a seek or in a looping replay: the order of arrival and the portions do not matter."""
    truth = CLEAN[which]
    first = truth.recording.slider.stamp[0]
    span = truth.recording.slider.stamp[-1] - first
    jump, back = int(first + cut * span), int(first + to * span)
    streams, until = {}, {}
    for name in SENSORS:
        if (stream := getattr(truth.recording, name)) is not None:
            before, again = np.flatnonzero(stream.stamp <= jump), np.flatnonzero(stream.stamp >= back)
            streams[name], until[name] = taken(stream, np.concatenate([before, again])), taken(stream, before)
    finder = WindowFinder(truth.recording.rig)
    add = {"slider": finder.add_slider, "pusher": finder.add_pusher, "wrench": finder.add_wrench}
    windows: list[PushWindow] = []
    longest = max(map(len, streams.values()))
    for begin in range(0, longest, portion):
        for name in order:
            if name in streams:
                share = slice(begin * len(streams[name]) // longest, (begin + portion) * len(streams[name]) // longest)
                add[name](taken(streams[name], share))  # type: ignore[operator,arg-type] # one adder for each kind
                if begin:  # those that follow still have the old time
                    windows += finder.take_ready()
    windows += finder.finish()
    assert_true(windows, truth, [])
    if jump - back > 1.05 * SECOND:
        assert finder.counts["clock_set_back"] == 1
        expected = [w.start for w in found_in(replace(truth.recording, **until))[0]]
        assert [w.start for w in windows][: len(expected)] == expected
        later = [w for w in truth.windows if w.start >= back]
        assert len(windows) - len(expected) >= len(later) - 3  # a push that begins before it is tiled from there


def test_single_clock_set_back_does_not_block_the_other_streams() -> None:
    recording = translating_push(Push(0.5, 90.0))
    finder = WindowFinder(recording.rig)
    pusher = recording.pusher
    late = pusher.stamp > START + 20 * SECOND
    alone = replace(pusher, stamp=pusher.stamp - 5 * SECOND * late)
    windows: list[PushWindow] = []
    for begin in range(0, len(pusher), 100):
        feed(finder, replace(recording, pusher=alone), lambda of, part=slice(begin, begin + 100): taken(of, part))
        windows += finder.take_ready()
        assert sum(len(stamp) for _, stamp, _ in finder._postponed) < 10_000
    windows += finder.finish()
    assert finder.counts["clock_set_back"] == 1
    assert_true(windows, clean(recording), [(START + 20 * SECOND, START + 1000 * SECOND)])


def test_every_count_has_a_description() -> None:
    _, counts = found_in(MADE_UP.recording)
    assert set(counts) == set(FAULTS)
