# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Clocks: whether the stamps of slider and pusher belong together, throughout the recording.

In a push the tip is at the outline. Where the clocks are apart it is there at another time: of the lags tried, the one
that brings the tip nearest to the outline while the slider moves. The lags of single pushes show whether the clocks are
apart by a constant, drift, or were set. The stages that follow get the recording with that corrected, so that they do
not take a clock for a wrong outline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.finding import Evidence, Finding, Value
from push_predictor.recordings.checks.motion import SPANS, in_time, motion_of, noise_of, slider_motion, values_at
from push_predictor.recordings.checks.outline_findings import clocks_apart
from push_predictor.recordings.checks.outline_fit import DOUBT, LAG_ALLOWANCE, MEDIAN_SD, TIE, contacts_of, fit_outline
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.windows.regular_stamps import SD
from push_predictor.types import Array, BoolArray, IntArray

Name: TypeAlias = Literal["slider", "pusher"]
FEWEST_PUSHES = 8
LEAST_SHARE = 0.2  # of the slider's motions that are pushes at the outline, for one lag or another
LEAST_PART = 4  # pushes between two steps of a clock
CONSISTENT = 0.02  # s; lags that differ more are those of something else than clocks
LARGEST_STEP = 0.1  # s: half a window of the default duration; beyond it windows on one side are of another moment
SAME_STEP = 0.3  # a jump of a stream's stamps is the step if it differs by less than this share

SYNCHRONISE = "Synchronise the clocks (chrony, PTP) before the recording starts"
ComplexArray: TypeAlias = NDArray[np.complex128]
LONGEST = 1.0  # s: lags that are tried around 0, and around a longer lag at which the motions are alike
FARTHEST = 120.0  # s: of these longer lags
GRID = 0.05  # s: of the velocities that are compared for them
BLOCK, TOUCHING = 20, 0.2  # pushes of one longer lag; share of them at the outline up to which one is sought
COARSE, FINE = 0.025, 0.0025  # s between them: first all, then around the best
ROUNDING = 0.5 * FINE  # s: of a lag
SAMPLES = 6  # of each push
MOST_PUSHES = 160  # evenly drawn
NOISE = 2.0  # standard deviations of a position
SHORTEST = 0.15  # s that a slider moves in a push
LEAST_STEP = 0.0005  # m in GRID: smaller ones are hidden in noise
LARGEST_GAP = 0.005  # m: a larger one counts as this much
TOUCH = 0.001  # m, in the mean and beyond the tracker's noise: the tip was at the outline


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
        steps.append(_step(recording, recorded, size, sd, float(lags.time[end - 1]), float(lags.time[end])))
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
    if (drift := course.drift) is not None:
        ppm, sd = 1e6 * drift.value, 1e6 * (drift.sd or 0.0)
        sentence = (
            f"The slider's clock runs {abs(ppm):.0f} ppm (sd {sd:.2g}) {'fast' if ppm > 0.0 else 'slow'} against the "
            f"pusher's: {abs(0.06 * ppm):.1f} ms per minute."
        )
        advice = f"{SYNCHRONISE}, and keep them so. Contacts and outcomes are the more wrong, the later a push is."
        found.append(Finding("clock_drift", "warning", sentence, advice, {"drift": drift}))
    if course.steps:
        found.append(_steps(course.steps))
    return found


def _steps(steps: tuple[Step, ...]) -> Finding:
    stated = ", and ".join(
        f"{_clock(step)} by {1e3 * abs(step.size):.0f} ms (sd {1e3 * step.sd:.2g}), {step.time:.1f} s after the start"
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


# --- the lag of each push ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PushLags:
    """The pushes (n,) in which a lag brings the tip to the outline.

    time (n,): s from the slider's first stamp; lag (n,): s, positive where the slider's stamps are late. share: of the
    motions of the slider that these are.
    """

    time: Array
    lag: Array
    share: float


def push_lags(recording: Recording, rig: Rig) -> PushLags | None:
    """The lags of the slider's stamps by push, None if it does not move."""
    slider, pusher = recording.slider, recording.pusher
    if min(len(slider), len(pusher)) < SAMPLES:
        return None
    origin = int(slider.stamp[0])
    time, pose = in_time(slider.stamp, origin, slider.x, slider.y, np.unwrap(slider.heading))
    tip_time, tip = in_time(pusher.stamp, origin, pusher.x, pusher.y)
    rows = _rows(time, slider_motion(time, pose, rig)[0])
    if not len(rows):
        return None
    at = time[rows]
    noise = NOISE * float(np.max(noise_of(pose[:, :2])))

    def cost(lag: Array, pushes: IntArray) -> Array:
        """Mean distances (n,) m of the tip from the outline in pushes (n,), at their lags (n,)."""
        when = (at[pushes] - lag[:, None]).ravel()
        gap = rig.outline.project(to_body(values_at(when, tip_time, tip), pose[rows[pushes].ravel()])).distance
        gap = np.minimum(np.abs(gap - rig.pusher_radius), LARGEST_GAP)
        return np.asarray(gap.reshape(-1, SAMPLES).mean(axis=1))

    def best(around: Array, pushes: IntArray) -> tuple[Array, BoolArray]:
        """The lags (n,) of the smallest distance near given ones, and whether the tip was at the outline then."""
        for step, reach in ((COARSE, LONGEST), (FINE, COARSE)):
            tried = around + np.arange(-reach, reach + 0.5 * step, step)[:, None]
            costs = np.array([cost(lag, pushes) for lag in tried])
            around = tried[np.argmin(costs, axis=0), np.arange(len(pushes))]
        return around, costs.min(axis=0) < TOUCH + noise

    lag, touched = best(np.zeros(len(at)), np.arange(len(at)))
    for pushes in np.array_split(np.arange(len(at)), max(1, len(at) // BLOCK)):
        if np.mean(touched[pushes]) < TOUCHING:
            span = (float(at[pushes[0], 0]), float(at[pushes[-1], -1]))
            longer = _like_lag(time, pose[:, :2], tip_time, tip, span)
            lag[pushes], touched[pushes] = best(np.full(len(pushes), longer), pushes)
    return PushLags(at.mean(axis=1)[touched], lag[touched], float(np.mean(touched)))


def _like_lag(time: Array, place: Array, tip_time: Array, tip: Array, span: tuple[float, float]) -> float:
    """The lag (s) at which the slider moves most like the tip within a span (s), wherever their frames are."""
    grid = np.arange(min(time[0], tip_time[0]), max(time[-1], tip_time[-1]) + 2.0 * FARTHEST, GRID)
    within = (grid > span[0]) & (grid < span[1])
    slider, pusher = (_direction(values_at(grid, *each)) for each in ((time, place), (tip_time, tip)))
    alike = np.abs(np.fft.ifft(np.conj(np.fft.fft(np.where(within, slider, 0.0))) * np.fft.fft(pusher)))
    shift = np.fft.fftfreq(len(grid), 1.0 / len(grid)) * GRID
    return -float(shift[np.argmax(np.where(np.abs(shift) < FARTHEST, alike, 0.0))])


def _direction(place: Array) -> ComplexArray:
    """Directions (n,) in which places (n, 2) change, as complex numbers of at most length 1; 0 at rest."""
    step = np.gradient(place[:, 0] + 1j * place[:, 1])
    return np.asarray(step / (np.abs(step) + LEAST_STEP))


def _rows(time: Array, moving: BoolArray) -> IntArray:
    """Indices (pushes, SAMPLES) of samples in the middle of each motion."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], moving.astype(np.int8), [0]])))
    spans = edges.reshape(-1, 2) - [0, 1]
    spans = spans[time[spans[:, 1]] - time[spans[:, 0]] > SHORTEST + 2.0 * SPANS[0]]
    if not len(spans):
        return np.empty((0, SAMPLES), dtype=np.int64)
    spans = spans[np.unique(np.linspace(0, len(spans) - 1, MOST_PUSHES).astype(np.int64))]
    begin, end = time[spans[:, 0]] + SPANS[0], time[spans[:, 1]] - SPANS[0]
    return np.asarray(np.searchsorted(time, np.linspace(begin, end, SAMPLES, axis=1)))
