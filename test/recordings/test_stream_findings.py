# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the check says of the streams by themselves, what each fault costs in windows, and where it is silent."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from checked_bags import bag, found, rig_of
from stream_faults import at_rate, extrapolated, flipped, held, in_bursts, lost, rounded, with_another

from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import ellipse, square
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.places import exchanged, places_of, two_bodies, without_flips
from push_predictor.recordings.checks.poses import StreamFacts, pose_facts
from push_predictor.recordings.checks.streams import (
    clocks_never_meet,
    in_order,
    repeated_samples,
    stamp_findings,
    unset_stamps,
)
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream, joined, taken
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array, IntArray

NAME = "ellipse_plywood"
MS, SECOND = 1_000_000, 1_000_000_000
MM = 1e-3
BODIES = ("slider", "pusher")


def altered(**streams: PoseStream | WrenchStream) -> Recording:
    """The sound recording with other streams."""
    return replace(bag(NAME), **streams)


def findings_of(recording: Recording) -> dict[str, Finding]:
    return found(recording, rig_of(NAME))


def named(recording: Recording) -> dict[str, str]:
    return {name: finding.severity for name, finding in findings_of(recording).items()}


def windows_of(recording: Recording) -> list[PushWindow]:
    return find_windows(recording, rig_of(NAME))


@cache
def sound_windows() -> list[PushWindow]:
    return windows_of(bag(NAME))


def in_windows(stream: PoseStream, every: int = 4) -> IntArray:
    """Indices of samples in the middle of some windows."""
    return np.searchsorted(stream.stamp, [window.start + 60 * MS for window in sound_windows()[::every]])


def pairs_of(windows: list[PushWindow], others: list[PushWindow]) -> list[tuple[PushWindow, PushWindow]]:
    """Pairs of windows that begin within 30 ms of each other."""
    start = np.array([window.start for window in windows])
    pairs = [(windows[int(np.argmin(np.abs(start - other.start)))], other) for other in others]
    return [(one, other) for one, other in pairs if abs(one.start - other.start) < 30 * MS]


def assert_alike(windows: list[PushWindow], others: list[PushWindow], most: float, fewer: float = 0.03) -> None:
    """About as many windows, whose displacements differ by less than `most` m, but for the tenth of the largest."""
    assert len(others) == pytest.approx(len(windows), rel=fewer)
    differences = [np.linalg.norm((a.displacement - b.displacement)[:2]) for a, b in pairs_of(windows, others)]
    assert len(differences) > 0.9 * len(others) and np.percentile(differences, 90.0) < most


def crossing(windows: list[PushWindow], stream: PoseStream, begins: IntArray, samples: int) -> int:
    """How many windows contain some of so many samples from each of some indices on."""
    spans = [(int(stream.stamp[k]), int(stream.stamp[k + samples - 1])) for k in begins.tolist()]
    return sum(any(window.start < end and window.end > begin for begin, end in spans) for window in windows)


def times(count: int, period: float = 10.0) -> IntArray:
    return SECOND + np.rint(period * MS * np.arange(count)).astype(np.int64)


def body(x: Array, heading: Array | None = None, period: float = 10.0) -> PoseStream:
    return PoseStream(times(len(x), period), x, 0.0 * x, 0.0 * x, 0.0 * x if heading is None else heading)


def recording_of(slider: PoseStream, pusher: PoseStream | None = None) -> Recording:
    return Recording("made", None, slider, slider if pusher is None else pusher, None)


def noise(count: int, sd: float, seed: int = 0) -> Array:
    return sd * np.random.default_rng(seed).standard_normal(count)


# --- the same faults of slider and tip --------------------------------------------------------------------------------


def another(stream: PoseStream, rate: int) -> PoseStream:
    return with_another(stream, np.arange(stream.stamp[0] + 3 * MS, stream.stamp[-1], SECOND // rate))


def in_pushes(stream: PoseStream) -> IntArray:
    return np.arange(300, len(stream) - 300, 40)


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize(
    ("fault", "finding", "severity"),
    [
        (lambda of: lost(of, in_pushes(of), 12), "held_poses_{}", "warning"),
        (lambda of: held(of, 30.0), "repeated_poses_{}", "warning"),
        (lambda of: another(of, 10), "two_bodies_{}", "warning"),
        (lambda of: another(of, 50), "two_bodies_{}", "refused"),
        (lambda of: with_another(of, of.stamp), "two_bodies_{}", "refused"),
        (lambda of: with_another(of, of.stamp, first=True), "two_bodies_{}", "refused"),
        (lambda of: replace(of, stamp=in_bursts(of.stamp)), "stamp_bursts", "warning"),
        (lambda of: rounded(of, 2e-4, 1e-3), "resolution_{}", "warning"),
        (lambda of: rounded(of, 1e-3, 1e-2), "resolution_{}", "refused"),
        (lambda of: at_rate(of, 10.0), "rate_{}", "refused"),
        (lambda of: at_rate(of, 15.0), "rate_{}", "warning"),
        (lambda of: at_rate(of, 30.0), "", ""),
        (lambda of: replace(of, stamp=np.zeros_like(of.stamp)), "stamps_unset", "refused"),
    ],
)  # fmt: skip
def test_a_fault_is_named_for_the_body_that_has_it(name: str, fault, finding: str, severity: str) -> None:  # type: ignore[no-untyped-def]
    findings = findings_of(altered(**{name: fault(getattr(bag(NAME), name))}))
    assert {key: each.severity for key, each in findings.items()} == (
        {finding.format(name): severity} if finding else {}
    )
    assert all(name in each.sentence for each in findings.values())


# --- stamps -----------------------------------------------------------------------------------------------------------


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
@pytest.mark.parametrize("name", [*BODIES, "wrench"])
def test_stamps_that_were_never_set_are_named(name: str, stamp, why: str) -> None:  # type: ignore[no-untyped-def]
    stream = getattr(bag(NAME), name)
    findings = findings_of(altered(**{name: replace(stream, stamp=stamp(stream.stamp))}))
    assert list(findings) == ["stamps_unset"] and "--stamp log" in findings["stamps_unset"].advice
    assert f"{name} (" in findings["stamps_unset"].sentence and why in findings["stamps_unset"].sentence


def test_stamps_that_may_be_measured_are_set() -> None:
    soon = 5 * SECOND + 100_000 * np.arange(20)  # in the first 2 ms of a second
    whole = SECOND * np.arange(20)  # one a second
    assert unset_stamps({"slider": soon, "pusher": whole}) is None


def test_clocks_that_never_meet_are_named_before_anything_about_motion() -> None:
    pusher = replace(bag(NAME).pusher, stamp=bag(NAME).pusher.stamp - bag(NAME).pusher.stamp[0])
    findings = findings_of(altered(pusher=pusher))
    assert list(findings) == ["clocks_never_meet"]
    (finding,) = clocks_never_meet({"slider": times(100), "pusher": times(100) - 5400 * SECOND})
    assert "the pusher's begin 5400 s before the slider's" in finding.sentence
    assert finding.values["pusher_apart"].value == pytest.approx(-5400.0)


def test_stamps_in_bursts_are_regular_again() -> None:
    slider = at_rate(bag(NAME).slider, 50.0)
    again = windows_of(altered(slider=replace(slider, stamp=in_bursts(slider.stamp))))
    assert_alike(windows_of(altered(slider=slider)), again, 3e-4)


def bursts(stamp: IntArray) -> str | None:
    found_bursts = stamp_findings({"slider": stamp})
    return found_bursts[0].sentence if found_bursts and found_bursts[0].name == "stamp_bursts" else None


def test_stamps_together_are_bursts_where_they_cost_something() -> None:
    rng = np.random.default_rng(0)
    close = SECOND + np.cumsum(np.where(rng.random(2000) < 0.3, 1 * MS, 14 * MS))
    assert bursts(close) is None  # no gap, no grid
    assert "of the time are gaps" in (bursts(SECOND + np.cumsum(rng.exponential(10.0, 2000) * MS).astype(int)) or "")
    pause = times(1000)
    pause[500:] += 1000 * SECOND
    assert bursts(pause) is None
    once = times(1010, 20.0)
    once[300:400] = in_bursts(once[300:400])
    assert bursts(once) is None and pose_facts(replace(body(noise(1010, MM)), stamp=once), False)[1].stamp is once


# --- repeats ----------------------------------------------------------------------------------------------------------

MOVES = 0.05 * np.sin(np.linspace(0.0, 4.0 * np.pi, 600))


def test_a_message_sent_twice_and_a_loop_count_once() -> None:
    sound = bag(NAME)
    doubled = altered(slider=taken(sound.slider, np.repeat(np.arange(len(sound.slider)), 2)))
    loop = altered(**{name: joined([getattr(sound, name)] * 2) for name in (*BODIES, "wrench")})
    for recording, name in ((doubled, "sent_twice"), (loop, "loop_recorded")):
        names = named(recording)
        assert names[name] == "warning" and not any(each.startswith("units") for each in names)
        assert [window.start for window in windows_of(recording)] == [window.start for window in sound_windows()]


def test_samples_are_in_order_once_and_few_repeats_are_no_finding() -> None:
    stream = body(MOVES)
    for often, severity in ((30, None), (10, "sent_twice")):
        again = taken(stream, np.sort(np.concatenate([np.arange(600), np.arange(0, 600, often)])))
        finding = repeated_samples(recording_of(again, stream))
        assert (None if finding is None else finding.name) == severity
        assert np.array_equal(in_order(again).stamp, stream.stamp)


# --- places -----------------------------------------------------------------------------------------------------------


def two_places(length: int, period: int, away: float = 0.3, count: int = 2000) -> Array:
    return np.where(np.arange(count) % period < length, away, 0.0) + noise(count, 1e-4)


def returns(x: Array, period: float = 10.0) -> int:
    return places_of(body(x, period=period)).returns


def test_returns_to_a_place_that_was_just_left_are_counted() -> None:
    assert returns(two_places(2, 100)) == pytest.approx(20, abs=2)
    assert returns(two_places(200, 400)) == 0  # put back after seconds
    zeros = np.where(np.arange(2000) % 50 < 2, 0.0, 0.3 + noise(2000, 1e-4))
    assert returns(zeros) == 0  # lost
    assert returns(1e3 * (1e-4 * np.arange(2000) + noise(2000, 1e-4))) == 0  # in mm
    near = np.tile(np.repeat([0.0, 0.07, 0.015, 0.085], 10), 50)  # near to where it was, but not there
    assert returns(near + 0.1 * np.repeat(np.arange(50), 40)) == 0


def test_few_returns_are_no_second_body() -> None:
    stream = body(two_places(2, 100, count=450))
    assert 0 < places_of(stream).returns < 5 and two_bodies("slider", places_of(stream)) is None


def swaps(spans: list[tuple[int, int]], late: int = 0) -> Finding | None:
    """Slider at 0 and tip at 0.2 m that take each other's place for some samples; the tip so many samples later."""
    k = np.arange(2000)
    slider, tip = np.zeros(2000), np.full(2000, 0.2)
    for begin, end in spans:
        slider[(k >= begin) & (k < end)] = 0.2
        tip[(k >= begin + late) & (k < end + late)] = 0.0
    recording = recording_of(body(slider + noise(2000, 1e-4)), body(tip + noise(2000, 1e-4, 1)))
    return exchanged(recording, places_of(recording.slider), places_of(recording.pusher))


def test_bodies_are_exchanged_in_one_instant_for_a_while_or_for_good() -> None:
    for spans, share, severity in (
        ([(300, 400)], 0.05, "warning"),
        ([(300, 400), (900, 1000)], 0.1, "warning"),
        ([(1500, 2001)], 0.25, "refused"),
    ):
        finding = swaps(spans)
        assert finding is not None and finding.severity == severity
        assert finding.values["share"].value == pytest.approx(share, abs=0.01)
        assert finding.values["begin"].value == pytest.approx(0.01 * spans[0][0], abs=0.02)
    assert swaps([(300, 600), (900, 1000)], late=50) is None


def test_bodies_that_take_each_others_place_are_named() -> None:
    def elsewhere(stream: PoseStream, other: PoseStream) -> PoseStream:
        away = np.isin((stream.stamp - bag(NAME).slider.stamp[0]) // SECOND, [5, 11, 17])
        x, y = (np.where(away, np.interp(stream.stamp, other.stamp, of), own)
                for of, own in ((other.x, stream.x), (other.y, stream.y)))  # fmt: skip
        return replace(stream, x=x, y=y)

    slider, pusher = bag(NAME).slider, bag(NAME).pusher
    names = named(altered(slider=elsewhere(slider, pusher), pusher=elsewhere(pusher, slider)))
    assert names["bodies_exchanged"] == "warning" and not any(name.startswith("units") for name in names)


# --- flips ------------------------------------------------------------------------------------------------------------

SQUARE, OVAL = square(0.1), ellipse(0.05, 0.04)


@pytest.mark.parametrize("degrees", [180.0, 120.0, 90.0])
def test_flips_are_undone_and_named(degrees: float) -> None:
    slider = bag(NAME).slider
    recording = altered(slider=flipped(slider, in_windows(slider), 15, np.radians(degrees)))
    finding = findings_of(recording)["heading_flips"]
    assert f"by {degrees:.0f} degrees" in finding.sentence and finding.severity == "warning"
    again = windows_of(recording)
    assert [window.start for window in again] == [window.start for window in sound_windows()]
    assert_alike(sound_windows(), again, 1e-9)


def flips(heading: Array, outline: Outline = OVAL) -> tuple[str, str] | None:
    finding, _ = without_flips(recording_of(body(noise(len(heading), 1e-5), heading)), outline)
    return None if finding is None else (finding.severity, finding.sentence)


def turns(turn: float, length: int = 5, period: int = 100) -> Array:
    return np.where((np.arange(2000) + 50) % period < length, turn, 0.0)


def test_headings_that_jump_by_any_angle_are_no_flips_and_a_single_flip_has_no_finding() -> None:
    assert flips(np.repeat(np.random.default_rng(0).uniform(-np.pi, np.pi, 100), 20)) is None
    assert flips(np.where(np.abs(np.arange(2000) - 1000) < 5, np.pi, 0.0)) is None


def test_usual_flips_are_listed_and_many_of_them_are_refused_unless_the_outline_is_symmetric() -> None:
    found_flips = flips(turns(np.pi) + np.where(np.abs(np.arange(2000) - 1050) < 5, np.pi / 2, 0.0))
    assert found_flips is not None and "by 180 degrees while" in found_flips[1] and found_flips[0] == "warning"
    often = turns(np.pi / 2, 40)
    assert [(flips(often, of) or ("", ""))[0] for of in (SQUARE, OVAL)] == ["warning", "refused"]


# --- poses that were not measured -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BODIES)
def test_poses_held_by_a_tracker_that_lost_the_body_are_cut(name: str) -> None:
    stream = getattr(bag(NAME), name)
    begins = in_windows(stream)
    recording = altered(**{name: lost(stream, begins, 12)})
    assert findings_of(recording)[f"held_poses_{name}"].values["holds"].value == pytest.approx(len(begins), abs=2)
    again = windows_of(recording)
    assert crossing(again, stream, begins, 12) <= 2
    assert_alike(sound_windows(), again, 2e-4, fewer=0.5)


@pytest.mark.parametrize("name", BODIES)
def test_poses_continued_by_a_tracker_are_cut(name: str) -> None:
    stream = getattr(bag(NAME), name)
    begins = in_windows(stream, every=8)
    recording = altered(**{name: extrapolated(stream, begins, 30)})
    finding = findings_of(recording)[f"continued_poses_{name}"]
    left = len(begins) - finding.values["runs"].value  # their end is where the body is
    assert finding.severity == "warning" and -1 <= left <= 0.3 * len(begins)
    assert crossing(windows_of(recording), stream, begins, 30) <= 1 + 2 * max(left, 0)


def test_a_single_continued_run_has_no_finding() -> None:
    slider = bag(NAME).slider
    moving = np.flatnonzero(np.abs(np.diff(slider.x, prepend=slider.x[0])) > 3e-4)
    assert not named(altered(slider=extrapolated(slider, moving[20:21], 12)))


# --- rate, resolution, noise ------------------------------------------------------------------------------------------


def facts(x: Array) -> StreamFacts:
    return pose_facts(body(x), angle=False)[0]


@pytest.mark.parametrize("rate", [20.0, 30.0, 60.0])
def test_a_slow_source_republished_is_named_with_its_rate(rate: float) -> None:
    recording = altered(slider=held(bag(NAME).slider, rate))
    finding = findings_of(recording)["repeated_poses_slider"]
    assert finding.values["rate"].value == pytest.approx(rate, rel=0.05)
    assert_alike(sound_windows(), windows_of(recording), 5e-4)


def test_a_slow_source_repeats_many_poses_of_a_body_that_moves() -> None:
    source = np.repeat(MOVES[::4], 4) + np.repeat(noise(150, 1e-4), 4)
    slow = facts(source)
    assert slow.slower_source and slow.source_period == pytest.approx(0.04, rel=0.05)
    assert slow.noise == pytest.approx(1e-4, rel=0.2)
    rests = np.repeat(1e-6 * np.arange(30), 20)
    assert not facts(np.concatenate([rests, MOVES])).slower_source
    single = MOVES.copy()
    single[20::20] = single[19:-1:20]
    assert not facts(single).slower_source


def test_a_body_that_was_lost_often_has_no_slow_source() -> None:
    x = MOVES.copy()
    for begin in range(30, 580, 40):
        x[begin : begin + 12] = x[begin - 1]
    known = facts(x)
    assert not known.slower_source and len(known.holds) >= 12 and known.held == 12 * len(known.holds)


def test_rounding_is_noise_too_and_its_steps_are_smoothed() -> None:
    slow = facts(MM * np.round(0.03 * np.arange(2000)))
    assert slow.noise == pytest.approx(MM / np.sqrt(12.0)) and slow.coarse
    true = 1.3 * MM * np.arange(600)  # none is repeated
    known, repaired = pose_facts(body(MM * np.round(true / MM)), angle=False)
    assert not known.held and np.max(np.abs(repaired.x - true)[50:]) < 0.4 * MM


def test_a_coarse_resolution_is_stated_and_used() -> None:
    sound = bag(NAME)
    fine = altered(slider=rounded(sound.slider, 1e-4, 1e-4), pusher=rounded(sound.pusher, 1e-4, 1e-4))
    assert "a resolution of 0.1 mm" in findings_of(fine)["resolution_pusher"].sentence
    again = windows_of(fine)
    assert_alike(sound_windows(), again, 3e-4)
    assert np.std([a.velocity - b.velocity for a, b in pairs_of(sound_windows(), again)]) < 0.0015
    coarse = altered(pusher=rounded(sound.pusher, 1e-3, 1e-3))
    assert all(window.velocity >= 0.0015 for window in windows_of(coarse))


@pytest.mark.parametrize(("name", "rate"), [("pusher", 15.0), ("slider", 20.0)])
def test_a_slow_stream_gives_the_windows_of_a_fast_one(name: str, rate: float) -> None:
    """The tip's velocity is that within the window: no sample of after a push, in which it rests, is in it."""
    again = windows_of(altered(**{name: at_rate(getattr(bag(NAME), name), rate)}))
    assert_alike(sound_windows(), again, 3e-4, fewer=0.05)
    differences = [abs(a.velocity - b.velocity) for a, b in pairs_of(sound_windows(), again)]
    assert np.percentile(differences, 95.0) < 0.001


def test_noise_is_estimated_and_named() -> None:
    slider, pusher = bag(NAME).slider, bag(NAME).pusher
    x, heading = slider.x + noise(len(slider), MM), slider.heading + noise(len(slider), 0.01, 1)
    finding = findings_of(altered(slider=replace(slider, x=x, heading=heading)))["noise_slider"]
    assert finding.values["noise"].value == pytest.approx(MM, rel=0.1)
    assert finding.values["heading_noise"].value == pytest.approx(0.01, rel=0.1)
    assert named(altered(pusher=replace(pusher, x=pusher.x + noise(len(pusher), MM))))["speed_noise"] == "refused"
