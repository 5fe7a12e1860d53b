# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Clocks: whether the stamps of slider and pusher belong together, throughout the recording.

The lags of single pushes show whether the clocks are apart by a constant, drift, or were set. The stages that follow
get the recording with that corrected, so that they do not take a clock for a wrong outline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from push_predictor.recordings.checks.clocks.push_lags import FINE, PushLags, push_lags
from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.geometry.outline_findings import DOUBT, LAG_ALLOWANCE, clocks_apart, time_apart
from push_predictor.recordings.checks.geometry.outline_fit import MEDIAN_SD, TIE, fit_outline
from push_predictor.recordings.checks.geometry.stage import contacts_of
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.windows.repairs.regular_stamps import SD
from push_predictor.types import Array

Name: TypeAlias = Literal["slider", "pusher"]
FEWEST_PUSHES = 8
LEAST_SHARE = 0.2  # of the slider's motions that are pushes at the outline, for one lag or another
LEAST_PART = 4  # pushes between two steps of a clock
CONSISTENT = 0.02  # s; lags that differ more are those of something else than clocks
ROUNDING = 0.5 * FINE  # s: of a lag
LARGEST_STEP = 0.1  # s: half a window of the default duration; beyond it windows on one side are of another moment
SAME_STEP = 0.3  # a jump of a stream's stamps is the step if it differs by less than this share

SYNCHRONISE = "Synchronise the clocks (chrony, PTP) before the recording starts"


@dataclass(frozen=True)
class Step:
    """A clock that was set: by how much (s) the lag of the slider's stamps grows, its sd, and when (s).

    stream, index: the sample from which on the stamps of that stream are others. seen: whether they jump there; else it
    may as well be the other stream.
    """

    size: float
    sd: float
    time: float
    stream: Name
    index: int
    seen: bool


@dataclass(frozen=True)
class Course:
    """The lag of the slider's stamps along a recording: at its start (s), its steps, or its drift (s/s).

    spread: median distance (s) of the lags of single pushes from it.
    """

    lag: Value
    spread: float
    steps: tuple[Step, ...] = ()
    drift: Value | None = None


def clock_stage(evidence: Evidence) -> Evidence:
    """Whether the stamps of the streams belong together, throughout the recording."""
    recording, rig = evidence.recording, evidence.rig
    if evidence.has("world_tilted"):
        return evidence
    lags = push_lags(recording, rig)
    if lags is None or len(lags.lag) < FEWEST_PUSHES or lags.share < LEAST_SHARE:
        return evidence
    course = course_of(lags, recording, evidence.recorded or recording)
    if course.spread > CONSISTENT:
        return evidence
    if abs(course.lag.value) <= DOUBT * (course.lag.sd or 0.0) + LAG_ALLOWANCE:
        course = replace(course, lag=Value(0.0, "s", course.lag.sd))
    found = _findings(course)
    corrected = with_course_corrected(recording, course)
    if found and not _explains(recording, corrected, rig):
        return evidence
    return evidence.found(found, corrected if found else recording, synchronous=True)


def course_of(lags: PushLags, recording: Recording, recorded: Recording) -> Course:
    """The simplest course of the clocks that explains the lags of at least FEWEST_PUSHES pushes.

    recorded: with the samples that the recording lacks, such as those after a clock was set back.
    """
    ends = _split(lags.lag)
    parts = np.split(lags.lag, ends)
    drift, line = _line(lags)
    pushes = len(lags.lag)
    apart = np.concatenate([part - np.median(part) for part in parts])
    steps_score = _score(apart, 2 * len(ends) + 1)
    left, span = lags.lag - line - drift.value * lags.time, float(np.ptp(lags.time))
    drifts = abs(drift.value) * span > DOUBT * (drift.sd or 0.0) * span + LAG_ALLOWANCE
    if drifts and _score(left, 2) < steps_score:
        return Course(Value(line, "s", _sd(left)), float(np.median(np.abs(left))), drift=drift)
    steps = []
    for k, end in enumerate(ends):
        size = float(np.median(parts[k + 1]) - np.median(parts[k]))
        sd = float(np.hypot(_sd(parts[k]), _sd(parts[k + 1])))
        steps.append(
            _step(recording, recorded, size, sd, float(lags.time[end - 1]), float(lags.time[min(end, pushes - 1)]))
        )
    lag, spread = Value(float(np.median(parts[0])), "s", _sd(parts[0])), float(np.median(np.abs(apart)))
    return Course(lag, spread, tuple(steps))


def with_course_corrected(recording: Recording, course: Course) -> Recording:
    """The recording with all stamps on one clock."""
    slider, pusher = recording.slider, recording.pusher
    elapsed = 1e-9 * (slider.stamp - slider.stamp[0])
    stamps = {"slider": slider.stamp - round(1e9 * course.lag.value), "pusher": pusher.stamp.copy()}
    if course.drift is not None:
        stamps["slider"] = stamps["slider"] - np.round(1e9 * course.drift.value * elapsed).astype(np.int64)
    for step in course.steps:
        sign = -1 if step.stream == "slider" else 1
        stamps[step.stream][step.index :] += sign * round(1e9 * step.size)
    return replace(
        recording, slider=replace(slider, stamp=stamps["slider"]), pusher=replace(pusher, stamp=stamps["pusher"])
    )


def _findings(course: Course) -> list[Finding]:
    found = []
    if course.lag.value != 0.0:
        found.append(clocks_apart(course.lag, "At the start, the" if course.steps or course.drift else "The"))
    if course.drift is not None:
        found.append(_drift(course.drift))
    if course.steps:
        found.append(_steps(course.steps))
    return found


def _drift(drift: Value) -> Finding:
    ppm, sd = 1e6 * drift.value, 1e6 * (drift.sd or 0.0)
    sentence = (
        f"The slider's clock runs {abs(ppm):.0f} ppm (sd {sd:.2g}) {'fast' if ppm > 0.0 else 'slow'} against the "
        f"pusher's: {abs(0.06 * ppm):.1f} ms per minute."
    )
    advice = f"{SYNCHRONISE}, and keep them so. Contacts and outcomes are the more wrong, the later a push is."
    return Finding("clock_drift", "warning", sentence, advice, {"drift": drift})


def _steps(steps: tuple[Step, ...]) -> Finding:
    stated = ", and ".join(
        f"{_clock(step)} by {time_apart(step.size)} (sd {1e3 * step.sd:.2g} ms), {step.time:.1f} s after the start"
        for step in steps
    )
    sentence = f"A clock was set during the recording: {stated}."
    advice = f"{SYNCHRONISE}, and do not set them while it runs. Pushes on one side of the step have wrong contacts."
    values: dict[str, Value] = {}
    for number, step in enumerate(steps, 1):
        end = f"_{number}" if len(steps) > 1 else ""
        values |= {f"step{end}": Value(step.size, "s", step.sd), f"time{end}": Value(step.time, "s")}
    largest = max(abs(step.size) for step in steps)
    return Finding("clock_step", "refused" if largest > LARGEST_STEP else "warning", sentence, advice, values)


def _clock(step: Step) -> str:
    """Whose clock was set, and which way."""
    if not step.seen:
        return f"the slider's stamps become {'later' if step.size > 0.0 else 'earlier'} against the pusher's"
    return f"the {step.stream}'s {'forward' if (step.size > 0.0) == (step.stream == 'slider') else 'back'}"


def _explains(before: Recording, after: Recording, rig: Rig) -> bool:
    """Whether the clocks explain what no correction of the outline and no constant lag explains."""
    costs = []
    for each in (before, after):
        if (contacts := contacts_of(motion_of(each, rig))) is None:
            return each is before
        costs.append(fit_outline(contacts, rig).cost)
    return TIE * costs[1] <= costs[0]


def _split(lag: Array) -> list[int]:
    """Indices at which the lags (n,) step, in order."""
    pushes = len(lag)
    if pushes < 2 * LEAST_PART:
        return []
    ends = range(LEAST_PART, pushes - LEAST_PART + 1)
    end = min(ends, key=lambda k: _spread(lag[:k]) + _spread(lag[k:]))
    size = abs(float(np.median(lag[end:]) - np.median(lag[:end])))
    if size <= DOUBT * float(np.hypot(_sd(lag[:end]), _sd(lag[end:]))) + LAG_ALLOWANCE:
        return []
    return [*_split(lag[:end]), end, *(end + each for each in _split(lag[end:]))]


def _spread(lag: Array) -> float:
    return float(np.sum(np.abs(lag - np.median(lag))))


def _sd(lag: Array) -> float:
    """Standard deviation (s) of the median of lags (n,)."""
    spread = max(float(SD * np.median(np.abs(lag - np.median(lag)))), ROUNDING)
    return MEDIAN_SD * spread / float(np.sqrt(len(lag)))


def _line(lags: PushLags) -> tuple[Value, float]:
    """Slope (s/s) and intercept (s) of the lags over time: the median of the slopes between two pushes."""
    one, other = np.triu_indices(len(lags.lag), 1)
    slope = float(np.median((lags.lag[other] - lags.lag[one]) / (lags.time[other] - lags.time[one])))
    left = lags.lag - slope * lags.time
    return Value(slope, "s/s", _sd(left) / float(np.std(lags.time))), float(np.median(left))


def _score(left: Array, parameters: int) -> float:
    """Bayesian information criterion of what is left (n,) of the lags, for errors with long tails."""
    pushes = len(left)
    return 2.0 * pushes * float(np.log(np.mean(np.abs(left)) + ROUNDING)) + parameters * float(np.log(pushes))


def _step(recording: Recording, recorded: Recording, size: float, sd: float, after: float, before: float) -> Step:
    """The step between two pushes (s): where the recorded stamps of a stream jump by as much, else in the middle."""
    origin = int(recording.slider.stamp[0])
    names: tuple[tuple[Name, float], ...] = (("slider", 1.0), ("pusher", -1.0))
    for name, sign in names:
        stamp = getattr(recorded, name).stamp
        time, jump = 1e-9 * (stamp - origin), 1e-9 * np.diff(stamp)
        near = (time[:-1] > after - abs(size)) & (time[:-1] < before + abs(size))
        near &= np.abs(jump - float(np.median(jump)) - sign * size) < SAME_STEP * abs(size)
        if near.any():
            last = int(np.flatnonzero(near)[0])  # with the clock before the step
            stream: PoseStream = getattr(recording, name)
            index = int(np.argmax(stream.stamp >= stamp[last])) + 1  # stamps decrease where a clock was set back
            return Step(size, sd, float(time[last]), name, index, True)
    index = int(np.searchsorted(recording.slider.stamp, origin + round(1e9 * 0.5 * (after + before))))
    return Step(size, sd, 0.5 * (after + before), "slider", index, False)
