# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of the samples so far, in a process of their own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest
from checks_in_process import checking_in_this_process
from lab_bags import LABORATORY, laboratory, short_recording
from mistakes import force_turned, late, scaled
from repository import REPOSITORY

from push_predictor.online.check_process import FIRST, MOST, CheckProcess, SampleCheck
from push_predictor.online.stream_health import Samples
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording
from push_predictor.replay.report import Delays, ReplayReport

HEXAGON = REPOSITORY / "bags" / "hexagon_delrin"
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def hexagon() -> Recording:
    return read_recording(HEXAGON)


def portions(recording: Recording, seconds: float = 1.0) -> Iterator[Samples]:
    """The streams in portions of that length."""
    assert recording.wrench is not None
    streams = (recording.slider, recording.pusher, recording.wrench)
    begin, end = min(int(s.stamp[0]) for s in streams), max(int(s.stamp[-1]) for s in streams)
    for start in range(begin, end + 1, round(seconds * SECOND)):
        parts = [(s.stamp >= start) & (s.stamp < start + seconds * SECOND) for s in streams]
        yield Samples(
            *(type(s)(*(getattr(s, f.name)[p] for f in fields(s))) for s, p in zip(streams, parts, strict=True))
        )


def wait(check: CheckProcess, work: object) -> None:
    deadline = monotonic() + 300.0
    while check.busy and monotonic() < deadline:
        work()  # type: ignore[operator]
        sleep(0.01)
    assert not check.busy


def checked(recording: Recording) -> CheckProcess:
    """The check of a recording."""
    samples = SampleCheck(require_rig(recording), False)
    for portion in portions(recording):
        samples.add(portion)
    samples.work()
    wait(samples.check, samples.work)
    return samples.check


@pytest.fixture
def in_this_process() -> Iterator[None]:
    with checking_in_this_process():
        yield


def test_sound_samples_are_sound(hexagon: Recording) -> None:
    check = checked(hexagon)
    assert (check.result, check.problems, check.failed) == ("sound", [], False)


@pytest.mark.usefixtures("in_this_process")
def test_a_warning_is_an_error_only_if_strict(hexagon: Recording) -> None:
    check, strict = checked(force_turned(hexagon, np.pi)), SampleCheck(require_rig(hexagon), True).check
    assert check.result == "wrench_sign"
    assert "change the sign" in check.problems[0]
    strict.findings = check.findings
    assert not check.failed and strict.failed


@pytest.mark.usefixtures("in_this_process")
def test_refused_samples_are_an_error(hexagon: Recording) -> None:
    assert checked(scaled(hexagon, "slider", 1e3)).failed


class Started:
    """In place of the process: what it was asked to check."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.recordings: list[Recording] = []
        monkeypatch.setattr(CheckProcess, "start", lambda _, recording, rig: self.recordings.append(recording))


def test_checks_come_as_the_samples_double(hexagon: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    started, samples = Started(monkeypatch), SampleCheck(require_rig(hexagon))
    for repeat in range(5):
        for portion in portions(late(hexagon, 0.0) if not repeat else shifted(hexagon, 30.0 * repeat)):
            samples.add(portion)
            samples.work()
    sizes = [len(recording.slider) for recording in started.recordings]
    assert len(sizes) == 3 and FIRST <= sizes[0] < 1.2 * FIRST
    assert sizes[1] >= 3 * FIRST and sizes[2] >= 7 * FIRST


def test_old_samples_are_forgotten(hexagon: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    started, samples = Started(monkeypatch), SampleCheck(require_rig(hexagon))
    for repeat in range(40):
        samples.add(next(portions(shifted(hexagon, 30.0 * repeat), 40.0)))
    samples.work()
    (recording,) = started.recordings
    assert MOST - len(hexagon.slider) < len(recording.slider) <= MOST
    assert recording.slider.stamp[-1] == hexagon.slider.stamp[-1] + 39 * 30 * SECOND


def test_a_clock_that_is_set_back_begins_again(hexagon: Recording, monkeypatch: pytest.MonkeyPatch) -> None:
    started, samples = Started(monkeypatch), SampleCheck(require_rig(hexagon))
    samples.add(next(portions(shifted(hexagon, 30.0), 40.0)))
    samples.add(next(portions(hexagon, 40.0)))
    samples.work()
    assert len(started.recordings[0].slider) == len(hexagon.slider)


@pytest.mark.usefixtures("in_this_process")
def test_a_recording_of_other_topics_is_checked_by_those_given(tmp_path: Path) -> None:
    """And is reported as not checked, with the reason, without them."""
    bag = laboratory(short_recording(2.0)).mcap(tmp_path / "lab", require_rig(short_recording(2.0)))
    named, unnamed = CheckProcess(), CheckProcess()
    named.start(bag, None, LABORATORY)
    unnamed.start(bag, None)
    wait(named, named.work)
    wait(unnamed, unnamed.work)
    assert (named.result, named.failure) == ("sound", "")
    assert "no topic /slider/pose and /pusher/pose" in unnamed.failure
    assert unnamed.result == f"not checked: {unnamed.failure}" and not unnamed.failed


def test_a_replay_reports_what_the_check_found() -> None:
    in_time = Delays(0.0, 0.0, 0.0)
    found = {"problems": ["wrong"], "check": "units_rig"}
    report = ReplayReport("bag", "playing", 1.0, 0, in_time, 0.0, 0, None, **found)
    assert report.warnings == ["wrong"] and report.values["data_check"] == "units_rig"


def shifted(recording: Recording, seconds: float) -> Recording:
    """The recording that much later."""
    assert recording.wrench is not None
    later = round(seconds * SECOND)
    slider, pusher, wrench = recording.slider, recording.pusher, recording.wrench
    return replace(
        recording,
        slider=replace(slider, stamp=slider.stamp + later),
        pusher=replace(pusher, stamp=pusher.stamp + later),
        wrench=replace(wrench, stamp=wrench.stamp + later),
    )
