# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push windows of recordings with a known motion."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from contact_portions import samples_at
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import START, Push, feed, moved, pose_stream, stamps, translating_push, windows_of

from push_predictor.recordings.streams import Recording, joined, taken
from push_predictor.recordings.windows.contact import ContactSamples
from push_predictor.recordings.windows.cut import pusher_motion
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.force import TARE_SAMPLES
from push_predictor.recordings.windows.push_segmenter import PushSegmenter
from push_predictor.recordings.windows.push_window import WindowOptions, windows_to_table
from push_predictor.recordings.windows.track import Track


def test_windows_tile_the_contact_end_to_end_from_first_touch() -> None:
    windows = windows_of(translating_push(Push(begin=0.5, end=1.6)))
    starts = np.array([(w.start - START) * 1e-9 for w in windows])
    assert starts == pytest.approx(0.5 + 0.2 * np.arange(5), abs=0.011)  # within a sample of the touch
    assert all(a.end == b.start for a, b in itertools.pairwise(windows))
    assert {w.push_id for w in windows} == {windows[0].push_id}
    assert [w.index for w in windows] == [0, 1, 2, 3, 4]


def test_translating_slider_moves_only_along_the_push() -> None:
    windows = windows_of(translating_push(Push(speed=0.03), contact=0.4))
    assert len(windows) == 5
    for window in windows:
        assert window.displacement == pytest.approx([0.006, 0.0, 0.0], abs=1e-12)
        assert (window.velocity, window.contact) == pytest.approx((0.03, 0.4), abs=1e-9)
        assert window.angle == pytest.approx(0.0, abs=1e-9)
        assert window.duration == pytest.approx(0.2, abs=1e-12)


def test_windows_state_what_the_sensor_read_in_free_motion_and_do_not_contain_it() -> None:
    plain = translating_push()
    biased = replace(plain, wrench=replace(plain.wrench, fx=plain.wrench.fx + 0.3, fy=plain.wrench.fy - 0.1))
    for a, b in zip(windows_of(plain), windows_of(biased), strict=True):
        for name, bias in (("free_force_x", 0.3), ("free_force_y", -0.1)):
            assert b.covariates[name] - a.covariates[name] == pytest.approx(bias, abs=1e-9)
        assert b.covariates["normal_force"] == pytest.approx(a.covariates["normal_force"], abs=1e-9)


@settings(max_examples=15, deadline=None)
@given(
    shift=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    turn=st.floats(-7.0, 7.0),
    contact=st.floats(0.0, 0.999),
)
def test_windows_do_not_depend_on_the_world_frame(shift: tuple[float, float], turn: float, contact: float) -> None:
    here = translating_push(contact=contact)
    there = moved(here, np.array(shift), turn)
    windows = windows_of(here)
    assert len(windows) == 5
    for a, b in zip(windows, windows_of(there), strict=True):
        assert (a.velocity, a.contact, a.angle) == pytest.approx((b.velocity, b.contact, b.angle), abs=1e-9)
        assert a.displacement == pytest.approx(b.displacement, abs=1e-9)


@settings(max_examples=12, deadline=None)
@given(cuts=st.lists(st.integers(1, 239), max_size=12, unique=True), order=st.permutations(range(3)))
def test_windows_do_not_depend_on_portions_and_interleaving(cuts: list[int], order: list[int]) -> None:
    recording = translating_push()
    finder, found = WindowFinder(recording.rig), []
    feeds = [
        (finder.add_slider, recording.slider),
        (finder.add_pusher, recording.pusher),
        (finder.add_wrench, recording.wrench),
    ]
    for first, last in itertools.pairwise([0, *sorted(cuts), len(recording.slider)]):
        for add, stream in (feeds[k] for k in order):
            add(taken(stream, slice(first, last)))
            found += finder.take_ready()
    found += finder.finish()
    whole = windows_of(recording)
    assert [(w.start, w.push_id, w.index) for w in found] == [(w.start, w.push_id, w.index) for w in whole]
    for a, b in zip(found, whole, strict=True):
        assert a.displacement == pytest.approx(b.displacement, abs=1e-12)
        assert (a.velocity, a.contact, a.angle) == pytest.approx((b.velocity, b.contact, b.angle), abs=1e-12)


@pytest.mark.parametrize("stream", ["slider", "pusher", "wrench"])
def test_no_window_spans_a_dropout(stream: str) -> None:
    recording = translating_push(Push(begin=0.5, end=2.5))
    time = (getattr(recording, stream).stamp - START) * 1e-9
    keep = (time < 1.2) | (time > 1.26)  # 60 ms without samples, six periods
    windows = windows_of(replace(recording, **{stream: taken(getattr(recording, stream), keep)}))
    assert windows and all((w.end - START) * 1e-9 < 1.22 or (w.start - START) * 1e-9 > 1.2 for w in windows)
    assert len({w.push_id for w in windows}) == 1  # still one push: its windows are not independent


def test_gap_of_three_periods_is_no_dropout() -> None:
    recording = translating_push(Push(begin=0.5, end=2.5))
    time = (recording.slider.stamp - START) * 1e-9
    gappy = replace(recording, slider=taken(recording.slider, (time < 1.195) | (time > 1.215)))
    assert len(windows_of(gappy)) == len(windows_of(recording))


def test_a_tip_that_is_lifted_or_has_no_force_is_not_in_contact() -> None:
    recording, wrench = translating_push(), translating_push().wrench
    assert windows_of(replace(recording, pusher=replace(recording.pusher, z=recording.pusher.z + 0.05))) == []
    assert windows_of(replace(recording, wrench=replace(wrench, fx=0.0 * wrench.fx, fy=0.0 * wrench.fy))) == []


def test_bias_of_the_force_sensor_is_not_contact() -> None:
    recording = translating_push(Push(begin=0.7, end=1.6))
    biased = replace(recording.wrench, fx=recording.wrench.fx + 5.0, fy=recording.wrench.fy - 3.0)
    same = windows_of(replace(recording, wrench=biased))
    assert [w.start for w in same] == [w.start for w in windows_of(recording)]


@pytest.mark.parametrize("speed", [0.005, 0.02, 0.1])
def test_contact_without_wrench_begins_when_the_gap_stops_shrinking(speed: float) -> None:
    push = Push(begin=0.8, end=2.1, speed=speed)
    windows = windows_of(replace(translating_push(push), wrench=None))
    assert len(windows) == 6
    assert (windows[0].start - START) * 1e-9 == pytest.approx(push.begin, abs=0.021)
    assert all(window.displacement[0] >= 0.9 * 0.2 * speed for window in windows)


@pytest.mark.parametrize("seed", range(10))
def test_push_from_rest_in_contact_begins_with_its_motion(seed: int) -> None:
    rng, rate = np.random.default_rng(seed), 250.0
    time = np.arange(0.0, 2.5, 1.0 / rate)
    driven = 0.02 * np.maximum(time - 1.0, 0.0)  # at rest in contact for a second, then 20 mm/s at once
    rig = translating_push().rig
    slider = np.column_stack([driven, np.zeros_like(time)])
    pusher = slider - [0.045 + rig.pusher_radius, 0.0] + 3e-5 * rng.standard_normal(slider.shape)
    still = np.zeros_like(time)
    recording = Recording("rest", rig, pose_stream(time, slider, still), pose_stream(time, pusher, still), None)
    first = windows_of(recording)[0]
    assert first.velocity == pytest.approx(0.02, rel=0.5)  # the fit may include the start of the motion
    assert abs(first.angle) < 0.45
    assert first.displacement[0] > 0.9 * 0.004


@pytest.mark.parametrize("portion", [1, 7, 100])
@pytest.mark.parametrize("gap", [0.0005, 0.1])  # at rest in contact, moving freely
def test_tare_is_the_mean_of_the_last_readings_before_the_push(gap: float, portion: int) -> None:
    segmenter = PushSegmenter(WindowOptions())
    force = np.concatenate([np.full(20, 1.0), np.linspace(1.0, 2.0, TARE_SAMPLES), [5.0]])
    pushes = np.arange(len(force)) == len(force) - 1
    samples = samples_at(
        0.004 * np.arange(len(force)), np.where(pushes, 0.0005, gap), force, np.where(pushes, 0.02, 0.0)
    )
    for begin in range(0, len(force), portion):
        segmenter.take(taken(samples, slice(begin, begin + portion)))
    assert segmenter.push.tare == pytest.approx((1.5, 0.0))


def test_a_window_may_end_with_the_last_sample_of_a_push() -> None:
    period, pushes = 10_000_000, np.arange(26) >= 5  # free motion, then a window of 20 periods from the sixth on
    samples = samples_at(
        1e-9 * period * np.arange(26), np.where(pushes, 0.0, 0.1), np.where(pushes, 5.0, 0.0), 0.02 * pushes
    )
    found = PushSegmenter(WindowOptions(duration=0.2)).take(samples)
    assert [each[:2] for each in found] == [(5 * period, 25 * period)]


def random_samples(rng: np.random.Generator, n: int) -> ContactSamples:
    """A tip that comes and goes, with a force that is missing at times, and breaks."""
    near = np.abs(np.cumsum(rng.normal(0.0, 2e-4, n))) - 1e-3
    gap = np.where(np.sin(0.02 * np.arange(n)) > 0.9, 0.02, near)
    force = np.where(gap < 1e-3, 1.5, 0.0) + rng.normal(0.0, 0.02, n)
    samples = samples_at(0.01 * np.arange(n), gap, force, np.abs(rng.normal(0.03, 0.02, n)), way=3e-4 * np.arange(n))
    rare = {name: rng.random(n) < 0.003 for name in ("in_break", "after_break", "repositioned")}
    return replace(
        samples,
        height=np.where(rng.random(n) < 0.02, 0.05, 0.0),
        closing_speed=rng.normal(0.0, 0.004, n),
        opening_speed=rng.normal(0.0, 0.004, n),
        force=np.where((rng.random(n) < 0.01)[:, None], np.nan, samples.force),
        **rare,
    )


@pytest.mark.parametrize("seed", range(2))
def test_segments_do_not_depend_on_the_portions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    samples, results = random_samples(rng, 4000), []
    for portion in (1, 13, 500, 4000):
        segmenter, found = PushSegmenter(WindowOptions(duration=0.05)), []
        for begin in range(0, len(samples), portion):
            found += segmenter.take(taken(samples, slice(begin, begin + portion)))
        windows = [(start, end, push.push_id, push.dwell, push.tare) for start, end, push in found]
        timing = [(time, str(delay)) for time, delay in segmenter.timing.touches]
        results.append((windows, segmenter.counts, segmenter.touching, segmenter.samples, timing))
    assert len(results[0][0]) > 5 and all(result == results[0] for result in results)


def test_two_contacts_are_two_pushes() -> None:
    first = translating_push()
    shift = int(first.slider.stamp[-1] - first.slider.stamp[0]) + 10_000_000
    streams = {name: getattr(first, name) for name in ("slider", "pusher", "wrench")}
    both = replace(first, **{k: joined([of, replace(of, stamp=of.stamp + shift)]) for k, of in streams.items()})
    windows, of_one = windows_of(both), len(windows_of(first))
    assert len(windows_to_table(windows).pushes) == 2
    assert [window.index for window in windows] == 2 * list(range(of_one))
    slid = np.cumsum([0.0, *(np.hypot(*window.displacement[:2]) for window in windows)])
    assert [window.covariates["slid_distance"] for window in windows] == pytest.approx(slid[:-1])


def test_short_stride_gives_overlapping_windows() -> None:
    tiled, overlapping = windows_of(translating_push()), windows_of(translating_push(), WindowOptions(stride=0.05))
    assert len(overlapping) > 3 * len(tiled)
    assert all(b.start - a.start == 50_000_000 for a, b in itertools.pairwise(overlapping))


@pytest.mark.parametrize("days", [0, 60])
def test_a_clock_that_is_set_back_or_far_ahead_loses_no_window(days: int) -> None:
    recording = translating_push()
    finder = WindowFinder(recording.rig)
    found = []
    for k in range(3):  # as in a looped replay
        feed(finder, recording, lambda of, ahead=86_400 * 10**9 * days * k: replace(of, stamp=of.stamp + ahead))
        found += finder.take_ready()
    found += finder.finish()
    assert finder.counts["clock_set_back"] >= 2
    assert len(found) == 3 * len(windows_of(recording))


def test_contact_at_a_vertex_belongs_to_the_edge_it_slid_along() -> None:
    recording = translating_push(Push(begin=0.5, end=2.5))
    rig = recording.rig
    time = (recording.slider.stamp - START) * 1e-9
    # The slider recedes as fast as the tip advances, while the tip slides along the first side and beyond its end.
    speed = 0.025
    advance = speed * (time - 0.5)
    y = -0.035 - speed * np.clip(time - 0.5, 0.0, 0.6)  # there it faces the next side more
    pusher = pose_stream(time, np.column_stack([advance - 0.045 - rig.pusher_radius, y]), np.zeros_like(time))
    slider = pose_stream(time, np.column_stack([advance, np.zeros_like(time)]), np.zeros_like(time))
    sliding = replace(recording, slider=slider, pusher=pusher, wrench=None)
    table = windows_to_table(windows_of(sliding, WindowOptions(touch_gap_alone=0.003)))
    beyond = table.inputs[:, 1] > 0.2499
    assert np.sum(beyond) >= 2
    assert np.all(table.covariates["edge"] == 0.0) and np.all(table.inputs[:, 1] < 0.25)


def test_the_force_on_the_slider_is_along_the_normal_and_to_its_left() -> None:
    recording = translating_push()
    sideways = replace(recording.wrench, fy=np.where(recording.wrench.fx != 0.0, 0.5, 0.0))
    windows = windows_of(replace(recording, wrench=sideways))
    assert len(windows) == 5
    for window in windows:
        assert window.covariates["normal_force"] == pytest.approx(2.0, abs=0.2)
        assert window.covariates["tangential_force"] == pytest.approx(-0.5)


def test_lines_through_the_tip_give_its_place_and_velocity_between_samples() -> None:
    pusher = Track(3, position=True)
    time = np.arange(100) * 0.004
    tip = np.column_stack([0.03 * time, 0.1 - 0.02 * time, 0.0 * time])
    pusher.extend(pusher.order.take(np.rint(1e9 * time).astype(np.int64), tip, True), 0)
    begin = np.array([0.0413, 0.2001, 0.3])
    place, velocity = pusher_motion(pusher, begin, begin + 0.2)
    np.testing.assert_allclose(place, np.column_stack([0.03 * begin, 0.1 - 0.02 * begin]), atol=1e-12)
    np.testing.assert_allclose(velocity, np.tile([0.03, -0.02], (3, 1)), atol=1e-10)


def test_memory_stays_bounded_over_a_long_stream() -> None:
    recording = translating_push()
    finder = WindowFinder(recording.rig)
    span = int(recording.slider.stamp[-1] - recording.slider.stamp[0]) + 10_000_000
    for k in range(30):
        feed(finder, recording, lambda of, late=k * span: replace(of, stamp=of.stamp + late))
        finder.take_ready()
    assert max(len(track) for track in finder._session.tracks.values()) < 2 * len(recording.slider)


def test_stamps_keep_their_nanoseconds() -> None:
    window = windows_of(translating_push())[0]
    assert window.start in stamps(np.arange(0.0, 3.0, 0.01)).tolist()
