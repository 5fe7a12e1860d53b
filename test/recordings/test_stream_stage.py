# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The streams by themselves: each fault of a tracker, a driver or a recorder is named, and costs what it must."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from checked_bags import bag, found, rig_of
from stream_faults import at_rate, extrapolated, flipped, held, in_bursts, lost, rounded, with_another

from push_predictor.recordings.streams import PoseStream, Recording, joined
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.flips import HeadingFlips
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.recordings.windows.regular_stamps import burst_period, missing_in_bursts
from push_predictor.recordings.windows.resolution import SPEED_ERROR, Resolution, fit_span
from push_predictor.recordings.windows.stamp_order import OrderedSamples
from push_predictor.recordings.windows.track import StreamRepairs, Track
from push_predictor.recordings.windows.unmeasured import HeldPoses, continued
from push_predictor.types import Array, IntArray

NAME = "ellipse_plywood"
MS = 1_000_000
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def sound() -> Recording:
    return bag(NAME)


@pytest.fixture(scope="module")
def windows(sound: Recording) -> list[PushWindow]:
    return find_windows(sound, rig_of(NAME))


def in_push(windows: list[PushWindow], stream: PoseStream, every: int = 4) -> IntArray:
    """Indices of samples in the middle of some windows."""
    return np.searchsorted(stream.stamp, [window.start + 60 * MS for window in windows[::every]])


def named(recording: Recording) -> dict[str, str]:
    return {name: finding.severity for name, finding in found(recording, rig_of(NAME)).items()}


def nearest(
    windows: list[PushWindow], others: list[PushWindow], within: float = 0.03
) -> list[tuple[PushWindow, PushWindow]]:
    """Pairs of windows of one push that begin within some seconds of each other."""
    start = np.array([window.start for window in windows])
    pairs = [(windows[int(np.argmin(np.abs(start - other.start)))], other) for other in others]
    return [(one, other) for one, other in pairs if abs(one.start - other.start) < 1e9 * within]


def worst(pairs: list[tuple[PushWindow, PushWindow]]) -> float:
    """The largest difference (m) of the displacements, without the tenth of the largest."""
    return float(np.percentile([np.linalg.norm((a.displacement - b.displacement)[:2]) for a, b in pairs], 90.0))


# --- stamps ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stamp", "why"),
    [
        (lambda of: np.zeros_like(of), "all 0"),
        (lambda of: np.full_like(of, of[0]), "all equal"),
        (lambda of: of // SECOND * SECOND, "whole seconds only"),
        (lambda of: of // SECOND * SECOND + of % SECOND // 1000, "1000 times too small"),
        (lambda of: of // SECOND * SECOND + of % SECOND // 1_000_000, "1e+06 times too small"),
    ],
)
@pytest.mark.parametrize("name", ["slider", "pusher", "wrench"])
def test_stamps_that_were_never_set_are_named(sound: Recording, name: str, stamp, why: str) -> None:  # type: ignore[no-untyped-def]
    stream = getattr(sound, name)
    findings = found(replace(sound, **{name: replace(stream, stamp=stamp(stream.stamp))}), rig_of(NAME))
    assert list(findings) == ["stamps_unset"]
    assert f"{name} (" in findings["stamps_unset"].sentence and why in findings["stamps_unset"].sentence
    assert "--stamp log" in findings["stamps_unset"].advice


def test_clocks_that_never_meet_are_named_before_anything_about_motion(sound: Recording) -> None:
    pusher = replace(sound.pusher, stamp=sound.pusher.stamp - sound.pusher.stamp[0])
    findings = found(replace(sound, pusher=pusher), rig_of(NAME))
    assert list(findings) == ["clocks_never_meet"]
    assert "The time of pusher counts from the start of a simulation" in findings["clocks_never_meet"].sentence


# --- repeats and places -----------------------------------------------------------------------------------------------


def test_a_message_sent_twice_and_a_loop_count_once(sound: Recording, windows: list[PushWindow]) -> None:
    twice = np.repeat(np.arange(len(sound.slider)), 2)
    doubled = replace(
        sound, slider=replace(sound.slider, **{k: v[twice] for k, v in vars(sound.slider).items() if v is not None})
    )
    assert named(doubled)["sent_twice"] == "warning"
    loop = replace(
        sound, slider=joined([sound.slider] * 2), pusher=joined([sound.pusher] * 2), wrench=joined([sound.wrench] * 2)
    )
    assert "loop_recorded" in named(loop)
    for recording in (doubled, loop):
        assert [window.start for window in find_windows(recording, rig_of(NAME))] == [
            window.start for window in windows
        ]
        assert not any(name.startswith("units") for name in named(recording))


@pytest.mark.parametrize(
    ("rate", "severity"), [(5.0, "warning"), (10.0, "warning"), (50.0, "refused"), (100.0, "refused")]
)
def test_poses_of_another_body_are_named(sound: Recording, rate: float, severity: str) -> None:
    stamp = np.arange(sound.slider.stamp[0] + 3 * MS, sound.slider.stamp[-1], round(1e9 / rate))
    names = named(replace(sound, slider=with_another(sound.slider, stamp)))
    assert names["two_bodies_slider"] == severity
    assert not any(name.startswith("units") for name in names)


def test_two_bodies_in_pairs_of_one_stamp_are_refused(sound: Recording) -> None:
    for first in (False, True):
        assert (
            named(replace(sound, slider=with_another(sound.slider, sound.slider.stamp, first)))["two_bodies_slider"]
            == "refused"
        )
    assert (
        named(replace(sound, pusher=with_another(sound.pusher, sound.pusher.stamp)))["two_bodies_pusher"] == "refused"
    )


def test_bodies_that_take_each_others_place_are_named(sound: Recording) -> None:
    slider, pusher = sound.slider, sound.pusher
    swapped = {"slider": {}, "pusher": {}}  # type: dict[str, dict[str, Array]]
    for axis in ("x", "y"):
        one, other = getattr(slider, axis).copy(), getattr(pusher, axis).copy()
        for begin in (5, 11, 17):
            first, last = slider.stamp[0] + begin * SECOND, slider.stamp[0] + (begin + 1) * SECOND
            mine, theirs = (
                (slider.stamp >= first) & (slider.stamp < last),
                (pusher.stamp >= first) & (pusher.stamp < last),
            )
            one[mine] = np.interp(slider.stamp[mine], pusher.stamp, getattr(pusher, axis))
            other[theirs] = np.interp(pusher.stamp[theirs], slider.stamp, getattr(slider, axis))
        swapped["slider"][axis], swapped["pusher"][axis] = one, other
    names = named(
        replace(sound, slider=replace(slider, **swapped["slider"]), pusher=replace(pusher, **swapped["pusher"]))
    )
    assert names["bodies_exchanged"] == "warning" and not any(name.startswith("units") for name in names)


# --- flips ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [180.0, 120.0, 90.0])
def test_flips_are_undone_and_named(sound: Recording, windows: list[PushWindow], degrees: float) -> None:
    begins = in_push(windows, sound.slider)
    recording = replace(sound, slider=flipped(sound.slider, begins, 15, np.radians(degrees)))
    finding = found(recording, rig_of(NAME))["heading_flips"]
    assert f"by {degrees:.0f} degrees" in finding.sentence and finding.severity == "warning"
    again = find_windows(recording, rig_of(NAME))
    assert [window.start for window in again] == [window.start for window in windows]
    assert worst(nearest(windows, again)) < 1e-9


def test_flips_do_not_depend_on_the_portions(sound: Recording, windows: list[PushWindow]) -> None:
    slider = flipped(sound.slider, in_push(windows, sound.slider), 15, np.pi)
    pose = np.column_stack([slider.x, slider.y, slider.heading])
    parts = HeadingFlips()
    found_in_parts = [parts.take(slider.stamp[k : k + 7], pose[k : k + 7]) for k in range(0, len(pose), 7)]
    whole = HeadingFlips().take(slider.stamp, pose)
    assert np.array_equal(np.concatenate(found_in_parts), whole) and np.any(whole != 0.0)


# --- held poses -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["slider", "pusher"])
def test_poses_held_by_a_tracker_that_lost_the_body_are_cut(
    sound: Recording, windows: list[PushWindow], name: str
) -> None:
    stream = getattr(sound, name)
    begins = in_push(windows, stream)
    recording = replace(sound, **{name: lost(stream, begins, 12)})
    finding = found(recording, rig_of(NAME))[f"held_poses_{name}"]
    assert finding.severity == "warning"
    assert finding.values["holds"].value == pytest.approx(len(begins), abs=2)
    spans = [(int(stream.stamp[k]), int(stream.stamp[k + 11])) for k in begins.tolist()]
    again = find_windows(recording, rig_of(NAME))
    crossing = [w for w in again if any(w.start < end and w.end > begin for begin, end in spans)]
    assert len(crossing) <= 2 and worst(nearest(windows, again)) < 2e-4


@pytest.mark.parametrize("rate", [20.0, 30.0, 60.0])
def test_a_slow_source_republished_is_named_with_its_rate(
    sound: Recording, windows: list[PushWindow], rate: float
) -> None:
    recording = replace(sound, slider=held(sound.slider, rate))
    finding = found(recording, rig_of(NAME))["repeated_poses_slider"]
    assert finding.values["rate"].value == pytest.approx(rate, rel=0.05)
    again = find_windows(recording, rig_of(NAME))
    assert len(again) == pytest.approx(len(windows), rel=0.03) and worst(nearest(windows, again)) < 5e-4


@pytest.mark.parametrize("name", ["slider", "pusher"])
def test_poses_continued_by_a_tracker_are_cut(sound: Recording, windows: list[PushWindow], name: str) -> None:
    stream = getattr(sound, name)
    begins = in_push(windows, stream, every=8)
    recording = replace(sound, **{name: extrapolated(stream, begins, 30)})
    finding = found(recording, rig_of(NAME))[f"continued_poses_{name}"]
    left = len(begins) - finding.values["runs"].value  # their end is where the body is
    assert finding.severity == "warning" and -1 <= left <= 0.3 * len(begins)
    spans = [(int(stream.stamp[k]), int(stream.stamp[k + 29])) for k in begins.tolist()]
    again = find_windows(recording, rig_of(NAME))
    assert sum(any(w.start < end and w.end > begin for begin, end in spans) for w in again) <= 1 + 2 * max(left, 0)


@pytest.mark.parametrize("name", ["slider", "pusher"])
def test_poses_on_a_line_between_two_measured_ones_are_kept(
    sound: Recording, windows: list[PushWindow], name: str
) -> None:
    stream = getattr(sound, name)
    begin = int(in_push(windows, stream, every=8)[0])
    inner, ends = np.arange(begin, begin + 8), [begin - 1, begin + 8]
    columns = {key: getattr(stream, key).copy() for key in ("x", "y")}
    for column in columns.values():
        column[inner] = np.interp(stream.stamp[inner], stream.stamp[ends], column[ends])
    assert not continued(replace(stream, **columns), angle=False)[inner].any()


def test_a_body_at_rest_without_noise_keeps_its_poses() -> None:
    time = np.arange(400) * 0.01
    x = 0.05 * np.clip(time - 1.0, 0.0, 1.5)
    stamp = np.rint(1e9 * time).astype(np.int64)
    values = np.column_stack([x, 0.0 * x, 0.0 * x, 0.0 * x, 0.0 * x])
    taken = HeldPoses(3).take(OrderedSamples(stamp, values, np.zeros(400, np.bool_)), final=True)
    assert np.array_equal(taken.stamp, stamp) and np.array_equal(taken.values, values)


def test_repairs_do_not_depend_on_the_portions(sound: Recording, windows: list[PushWindow]) -> None:
    cases = [
        sound.slider,
        lost(sound.slider, in_push(windows, sound.slider), 12),
        held(sound.slider, 30.0),
        rounded(sound.slider, 2e-4, 1e-3),
        at_rate(sound.slider, 20.0),
        replace(at_rate(sound.slider, 50.0), stamp=in_bursts(at_rate(sound.slider, 50.0).stamp)),
    ]
    for slider in cases:
        values = np.column_stack([slider.x, slider.y, slider.z, slider.heading])
        whole, parts = (StreamRepairs(Track(4, position=True, angle=3).is_jump, 3) for _ in range(2))
        at_once = whole.take(samples(slider.stamp, values), final=True)
        found_in_parts = [
            parts.take(samples(slider.stamp[k : k + 13], values[k : k + 13]), final=k + 13 >= len(values))
            for k in range(0, len(values), 13)
        ]
        assert np.array_equal(np.concatenate([part.stamp for part in found_in_parts]), at_once.stamp)
        np.testing.assert_allclose(np.concatenate([part.values for part in found_in_parts]), at_once.values, atol=1e-12)


def samples(stamp: IntArray, values: Array) -> OrderedSamples:
    return OrderedSamples(stamp, values, np.zeros(len(stamp), np.bool_))


# --- resolution, rate, noise ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [1e-3, 2.5e-4, 1e-4])
def test_the_resolution_is_measured(sound: Recording, step: float) -> None:
    values = np.column_stack([np.round(sound.pusher.x / step) * step, sound.pusher.y])
    known = Resolution(2).take(values)[-1]
    assert known[0] == pytest.approx(step, rel=1e-6) and known[1] < 2e-5


def test_a_line_over_the_span_of_a_resolution_has_the_stated_error() -> None:
    rng, step, period = np.random.default_rng(0), 2e-4, 0.01
    time = np.arange(round(float(fit_span(step, period)) / period)) * period
    slopes = [
        np.polyfit(time, np.round((speed * time + rng.uniform(0.0, step)) / step) * step, 1)[0] - speed
        for speed in rng.uniform(0.02, 0.08, 2000)
    ]
    assert 0.3 * SPEED_ERROR < np.std(slopes) < 1.2 * SPEED_ERROR


def test_a_coarse_resolution_is_stated_used_or_refused(sound: Recording, windows: list[PushWindow]) -> None:
    fine = replace(sound, slider=rounded(sound.slider, 1e-4, 1e-4), pusher=rounded(sound.pusher, 1e-4, 1e-4))
    findings = found(fine, rig_of(NAME))
    assert findings["resolution_pusher"].severity == "warning"
    assert "4 decimals (0.1 mm)" in findings["resolution_pusher"].sentence
    again = find_windows(fine, rig_of(NAME))
    assert len(again) == pytest.approx(len(windows), rel=0.03) and worst(nearest(windows, again)) < 3e-4
    pairs = nearest(windows, again)
    assert np.std([a.velocity - b.velocity for a, b in pairs]) < 0.0015
    coarse = replace(sound, pusher=rounded(sound.pusher, 1e-3, 1e-3))
    assert found(coarse, rig_of(NAME))["resolution_pusher"].severity == "refused"
    assert all(window.velocity >= 0.0015 for window in find_windows(coarse, rig_of(NAME)))


@pytest.mark.parametrize(("rate", "severity"), [(10.0, "refused"), (15.0, "warning"), (30.0, None)])
def test_a_low_rate_is_named_where_it_costs_something(sound: Recording, rate: float, severity: str | None) -> None:
    for name in ("slider", "pusher"):
        recording = replace(sound, **{name: at_rate(getattr(sound, name), rate)})
        assert named(recording).get(f"rate_{name}") == severity


def test_a_slow_tip_gives_the_windows_of_a_fast_one(sound: Recording, windows: list[PushWindow]) -> None:
    """Its velocity is that within the window: no sample of after a push, in which the tip rests, is in it."""
    for recording in (
        replace(sound, pusher=at_rate(sound.pusher, 15.0)),
        replace(sound, slider=at_rate(sound.slider, 20.0)),
    ):
        again = find_windows(recording, rig_of(NAME))
        assert len(again) == pytest.approx(len(windows), rel=0.05)
        pairs = nearest(windows, again)
        assert len(pairs) > 0.9 * len(again) and worst(pairs) < 3e-4
        assert np.percentile([abs(a.velocity - b.velocity) for a, b in pairs], 95.0) < 0.001


def test_noise_is_estimated_and_named(sound: Recording) -> None:
    rng = np.random.default_rng(0)
    x, heading = (
        of + sd * rng.standard_normal(len(of)) for of, sd in ((sound.slider.x, 1e-3), (sound.slider.heading, 0.01))
    )
    finding = found(replace(sound, slider=replace(sound.slider, x=x, heading=heading)), rig_of(NAME))["noise_slider"]
    assert finding.values["noise"].value == pytest.approx(1e-3, rel=0.1)
    assert finding.values["heading_noise"].value == pytest.approx(0.01, rel=0.1)
    tip = replace(sound.pusher, x=sound.pusher.x + 1e-3 * rng.standard_normal(len(sound.pusher)))
    assert named(replace(sound, pusher=tip))["speed_noise"] == "refused"


# --- bursts -----------------------------------------------------------------------------------------------------------


def test_stamps_in_bursts_are_regular_again(sound: Recording, windows: list[PushWindow]) -> None:
    slider = at_rate(sound.slider, 50.0)
    plain = find_windows(replace(sound, slider=slider), rig_of(NAME))
    recording = replace(sound, slider=replace(slider, stamp=in_bursts(slider.stamp)))
    assert named(recording)["stamp_bursts"] == "warning"
    again = find_windows(recording, rig_of(NAME))
    assert len(again) == pytest.approx(len(plain), rel=0.03) and worst(nearest(plain, again)) < 3e-4


def test_a_sample_that_is_missing_in_bursts_is_counted() -> None:
    grid = np.arange(0, 101 * 20 * MS, 20 * MS) + SECOND
    period = burst_period(in_bursts(grid))
    assert period == pytest.approx(0.02, rel=0.01)
    assert burst_period(grid) is None  # a regular stream
    random = np.cumsum(np.random.default_rng(0).exponential(20.0, 101) * MS).astype(np.int64)
    assert burst_period(random) is None  # no grid
    stamp = in_bursts(np.delete(grid, [50, 51]))
    missing = missing_in_bursts(stamp, 0.02)
    assert missing.sum() == 2 and abs(int(np.flatnonzero(missing)[0]) - 50) <= 4
    assert missing_in_bursts(np.delete(grid, [50, 51]), 0.02).sum() == 2  # the steps around it are equal
