# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Findings about the force of recordings whose wrench was altered as drivers and sensors do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from checked_bags import bag, rig_of
from mistakes import force_turned
from scipy.signal import lfilter

from push_predictor.geometry.outline import Outline
from push_predictor.recordings.checks.check import check_recording, evidence_of
from push_predictor.recordings.checks.finding import Evidence, Finding
from push_predictor.recordings.checks.force import rate_finding, wrench_findings
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.streams import Recording, WrenchStream, taken
from push_predictor.recordings.windows.finder import find_windows

NAME = "ellipse_plywood"  # 15 pushes at 20 to 50 mm/s
ONE_SIDE = "square_abs_repeats"  # 80 short pushes


def altered(name: str, alter: Callable[[WrenchStream], WrenchStream]) -> Recording:
    recording = bag(name)
    return replace(recording, wrench=alter(recording.wrench))


def only(recording: Recording, name: str = NAME) -> Finding:
    (finding,) = check_recording(recording, rig_of(name))
    assert finding.severity == "warning"
    return finding


def late(seconds: float) -> Callable[[WrenchStream], WrenchStream]:
    return lambda wrench: replace(wrench, stamp=wrench.stamp + round(1e9 * seconds))


def biased(x: float, y: float) -> Callable[[WrenchStream], WrenchStream]:
    return lambda wrench: replace(wrench, fx=wrench.fx + x, fy=wrench.fy + y)


@pytest.mark.parametrize(("name", "seconds"), [(NAME, 0.12), (NAME, -0.12), (ONE_SIDE, 0.02)])
def test_a_force_that_is_late_or_early_is_named_with_its_lag(name: str, seconds: float) -> None:
    finding = only(altered(name, late(seconds)), name)
    lag = finding.values["lag"]
    assert finding.name == "wrench_lag" and lag.sd is not None
    assert abs(lag.value - seconds) < 3.0 * lag.sd and lag.sd < 0.008
    assert (" after " in finding.sentence) == (seconds > 0.0)


@pytest.mark.parametrize("seconds", [0.12, -0.12])
def test_what_follows_gets_the_force_without_its_lag(seconds: float) -> None:
    """So that its axes and its zero are judged in the contacts."""
    recording = evidence_of(altered(NAME, late(seconds)), rig_of(NAME)).recording
    sound = bag(NAME).wrench
    assert np.max(np.abs(recording.wrench.stamp - sound.stamp)) < 20_000_000


def test_a_wrong_outline_shows_no_lag() -> None:
    """It shows touches elsewhere: nothing is said about the clock of the force, and no windows are kept."""
    rig = rig_of(NAME)
    larger = replace(rig, outline=Outline(1.1 * rig.outline.vertices))
    evidence = evidence_of(altered(NAME, late(0.12)), larger)
    assert evidence.findings and not evidence.has("wrench_lag") and evidence.windows is None
    assert evidence_of(bag(NAME), rig).windows is not None


def test_the_windows_of_a_check_are_those_of_the_recording_as_given() -> None:
    """Those of a recording without its wrong samples are not."""
    for recording in (bag(NAME), altered(NAME, late(0.12))):
        shared = evidence_of(recording, rig_of(NAME)).windows
        expected = find_windows(recording, rig_of(NAME))
        assert [(each.start, each.end) for each in shared] == [(each.start, each.end) for each in expected]
    stuck = altered(NAME, lambda wrench: replace(wrench, fx=np.full(len(wrench), 1.5), fy=np.full(len(wrench), -0.5)))
    assert evidence_of(stuck, rig_of(NAME)).windows is None


@pytest.mark.parametrize(("spread", "named"), [(0.1, True), (1.0, False)])
def test_a_zero_that_varies_as_much_as_it_is_off_is_no_constant(spread: float, named: bool) -> None:
    rig, rng = rig_of(NAME), np.random.default_rng(0)
    motion = motion_of(bag(NAME), rig)
    free = ~motion.contact[:, None]
    zero = [1.2, 0.0] + rng.uniform(-spread, spread, (len(motion.time), 1)) * [1.0, 0.0]
    force = np.where(free, zero, motion.force + [1.2, 0.0])
    found = wrench_findings(replace(motion, force=force), rig)
    assert [each.name for each in found] == (["wrench_zero"] if named else [])


def test_a_stage_gets_the_motion_of_the_samples_that_are_accepted() -> None:
    evidence = Evidence(bag(NAME), rig_of(NAME))
    motion = evidence.motion
    assert evidence.found([]).motion is motion
    shorter = replace(bag(NAME), slider=taken(bag(NAME).slider, slice(1000)))
    after = evidence.found([], shorter).motion
    assert after is not None and len(after.time) <= 1000


@pytest.mark.parametrize(("rate", "named"), [(19.0, True), (21.0, False)])
def test_a_force_below_20_hz_is_rare(rate: float, named: bool) -> None:
    stamp = np.arange(0, 10_000_000_000, round(1e9 / rate))
    still = np.zeros(len(stamp))
    assert (rate_finding(WrenchStream(stamp, still, still, still)) is not None) == named


def filtered(wrench: WrenchStream) -> WrenchStream:
    """By two first-order low-passes at 3 Hz, which delay half of a step's height by 87 ms."""
    share = 1.0 - np.exp(-2.0 * np.pi * 3.0e-9 * float(np.median(np.diff(wrench.stamp))))
    pass_low = partial(lfilter, [share], [1.0, share - 1.0])
    columns = {axis: getattr(wrench, axis) for axis in ("fx", "fy")}
    return replace(wrench, **{axis: pass_low(pass_low(of - of[0])) + of[0] for axis, of in columns.items()})


def drifting(wrench: WrenchStream) -> WrenchStream:
    return replace(wrench, stamp=wrench.stamp + np.linspace(0, 0.12e9, len(wrench)).astype(np.int64))


def stuck(share: float) -> Callable[[WrenchStream], WrenchStream]:
    """At one value from a share of the recording on."""

    def alter(wrench: WrenchStream) -> WrenchStream:
        late = np.arange(len(wrench)) >= int(share * len(wrench))
        return replace(wrench, fx=np.where(late, 1.5, wrench.fx), fy=np.where(late, -0.5, wrench.fy))

    return alter


def with_gaps(wrench: WrenchStream) -> WrenchStream:
    return replace(wrench, fx=np.where(np.arange(len(wrench)) % 900 >= 450, np.nan, wrench.fx))


@pytest.mark.parametrize(
    ("name", "alter", "finding", "words", "values"),
    [
        (NAME, lambda of: taken(of, slice(len(of) // 3)), "wrench_missing", "ends after 9 s of 26 s", {}),
        (NAME, lambda of: taken(of, slice(len(of) // 2, None)), "wrench_missing", "begins after 13 s", {}),
        (NAME, with_gaps, "wrench_missing", "NaN", {}),
        (NAME, stuck(0.0), "wrench_constant", "(1.5, -0.5) N", {"share": 1.0}),
        (NAME, stuck(0.6), "wrench_constant", "(1.5, -0.5) N", {"share": 0.4}),
        (NAME, lambda of: taken(of, slice(None, None, 5)), "wrench_rate", "10 Hz", {"rate": 10.0}),
        (NAME, biased(3.2, -2.4), "wrench_zero", "--wrench-bias free_motion", {"bias_x": 3.2, "bias_y": -2.4}),
        (NAME, biased(0.0, 1.5), "wrench_zero", "--wrench-bias free_motion", {"bias_x": 0.0, "bias_y": 1.5}),
        (NAME, lambda of: replace(of, fy=-of.fy), "wrench_frame", "are mirrored", {}),
        (ONE_SIDE, filtered, "wrench_lag", "without a filter", {"lag": 0.07}),
        (ONE_SIDE, drifting, "wrench_lag", "Its delay changes from", {}),
    ],
)
def test_what_a_sensor_or_its_driver_does_is_named(
    name: str, alter: Callable[[WrenchStream], WrenchStream], finding: str, words: str, values: dict[str, float]
) -> None:
    found = only(altered(name, alter), name)
    assert found.name == finding and words in found.text
    assert {key: found.values[key].value for key in values} == pytest.approx(values, abs=0.05)


def test_what_costs_little_is_no_finding() -> None:
    half_as_often = altered(NAME, lambda of: taken(of, slice(None, None, 2)))
    for recording in (half_as_often, altered(NAME, biased(0.4, 0.0)), force_turned(bag(NAME), np.radians(5.0))):
        assert check_recording(recording, rig_of(NAME)) == ()


def test_axes_of_the_tip_are_named_whether_it_turns_or_not() -> None:
    recording, elapsed = bag(NAME), bag(NAME).pusher.stamp - bag(NAME).pusher.stamp[0]
    for heading, words in (
        (np.radians(70.0) + 0.0 * elapsed, "use `--wrench-frame tip`"),
        (0.3e-9 * elapsed, "of the force are those of the tip"),
    ):
        turned = force_turned(recording, -np.interp(recording.wrench.stamp, recording.pusher.stamp, heading))
        finding = only(replace(turned, pusher=replace(recording.pusher, heading=heading)))
        assert finding.name == "wrench_frame" and words in finding.text


@pytest.mark.parametrize("degrees", [12.0, 43.0, -137.0, 165.0])
def test_the_angle_of_the_axes_is_named_with_its_sd(degrees: float) -> None:
    finding = only(force_turned(bag(NAME), np.radians(degrees)))
    turn = finding.values["turn"]
    assert finding.name == "wrench_frame" and turn.sd is not None
    assert abs(np.degrees(turn.value) - degrees) < 3.0 and np.degrees(turn.sd) < 3.0
    assert ("counter-clockwise of" in finding.sentence) == (degrees > 0.0)
    assert f"{abs(round(np.degrees(turn.value)))} degrees" in finding.advice and "--wrench-frame" in finding.advice


def test_a_zero_that_is_off_hides_no_wrong_axes() -> None:
    turned = force_turned(bag(NAME), np.radians(43.0))
    both = replace(turned, wrench=biased(3.2, -2.4)(turned.wrench))
    assert [each.name for each in check_recording(both, rig_of(NAME))] == ["wrench_zero", "wrench_frame"]
