# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rate, resolution and noise of the poses, and what they allow to learn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Severity, Value
from push_predictor.recordings.checks.motion import noise_of
from push_predictor.recordings.dropouts import usual_interval
from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.contact import FIT_SPAN
from push_predictor.recordings.windows.cut import FIT_SAMPLES
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.recordings.windows.regular_stamps import DECIDING, RegularStamps, burst_period
from push_predictor.recordings.windows.resolution import (
    LEVER,
    SHORTEST,
    Resolution,
    SmoothedPoses,
    changes,
    fit_span,
    lengths,
)
from push_predictor.recordings.windows.stamp_order import uninterrupted
from push_predictor.recordings.windows.unmeasured import ContinuedPoses, HeldPoses
from push_predictor.types import Array, IntArray

WINDOW = WindowOptions().duration  # s
TWO_LINES = 0.5  # of a window: longer lines at its begin and its end have samples in common
FEWEST_SAMPLES = 3  # in a window: with two, one push in thirty loses a window
ENOUGH = FIT_SAMPLES - 0.1  # samples in a window, for the line of its velocity
SPEED_NOISE, TOO_NOISY = 0.006, 0.01  # m/s of the tip: a third and half of those of a slow push
NOISY = 3e-4  # m: three times this is the gap below which a tip touches, and a window's outcome has 1.4 times this
FEWEST_HOLDS = FEWEST_RUNS = 2
LEAST_BURSTS = 0.5  # of the blocks of a stream
UNSEEN = "No window spans them. Let the tracker send nothing, or NaN, while it does not see the body."
LEAST_SHARE = 1.0 / 6.0  # of the poses in motion are repeats: the source is slower than its messages
MOST_HOLDS = 0.2  # of the runs of repeats are longer than usual
FEWEST_MOVING = 100  # samples in motion, from which the rate of the source is estimated
AROUND = 25  # samples on either side that show whether a body moves: more than a slow source repeats a pose
STEPS, LEAST_WAY = 3.0, 5e-5  # steps of the resolution, m: a body moves by more in one interval
ROUNDED = np.sqrt(12.0)  # standard deviations of a rounding error in one step


def quality_findings(facts: Mapping[str, StreamFacts]) -> list[Finding]:
    """Findings about streams of poses, by name."""
    every = (_lines, _resolution, _source, _holds, _rate, _noise)
    found = [of(name, each) for name, each in facts.items() for of in every]
    if "pusher" in facts:
        found.append(_speed_noise(facts["pusher"]))
    return [finding for finding in found if finding is not None]


def _lines(name: str, facts: StreamFacts) -> Finding | None:
    if facts.lines < FEWEST_RUNS:
        return None
    share = facts.lost / facts.samples
    sentence = (
        f"The {name}'s pose is continued on an exact line {facts.lines} times, without the noise of a measurement: "
        f"{100.0 * share:.1f} % of the samples are extrapolated."
    )
    values = {"runs": Value(float(facts.lines), "1"), "share": Value(share, "1")}
    return Finding(f"continued_poses_{name}", "warning", sentence, UNSEEN, values)


def _resolution(name: str, facts: StreamFacts) -> Finding | None:
    if not facts.coarse:
        return None
    sentence = f"The {name}'s positions have a resolution of {1e3 * facts.quantum:.2g} mm"
    if facts.heading_quantum > 0.0:
        sentence += f", its headings of {np.degrees(facts.heading_quantum):.2g} degrees"
    sentence += f": speeds need lines over {1e3 * facts.fit_span:.0f} ms, in place of 20 ms."
    advice = (
        f"Windows use such lines up to {1e3 * TWO_LINES * WINDOW:.0f} ms. Better: write at least 5 decimals of a metre "
        "and 4 of a radian."
    )
    severity: Severity = "refused" if facts.fit_span > TWO_LINES * WINDOW else "warning"
    values = {"quantum": Value(facts.quantum, "m"), "fit_span": Value(facts.fit_span, "s")}
    return Finding(f"resolution_{name}", severity, sentence, advice, values)


def _source(name: str, facts: StreamFacts) -> Finding | None:
    if facts.coarse or not facts.slower_source:
        return None
    rate = 1.0 / facts.source_period
    sentence = (
        f"The {name}'s poses are repeated: {1.0 / facts.period:.0f} messages a second carry {rate:.3g} poses a second."
    )
    advice = "Windows take the poses in between from lines. Record the topic of the source, with its own stamps."
    return Finding(f"repeated_poses_{name}", "warning", sentence, advice, {"rate": Value(rate, "Hz")})


def _holds(name: str, facts: StreamFacts) -> Finding | None:
    if facts.slower_source or len(facts.holds) < FEWEST_HOLDS or facts.coarse:
        return None
    share = 100.0 * facts.held / facts.samples
    sentence = (
        f"The {name}'s pose is repeated with new stamps {len(facts.holds)} times while the body moves on, for "
        f"{1e3 * float(np.median(facts.holds)):.0f} ms (median): {share:.1f} % of the samples are stale."
    )
    values = {"holds": Value(float(len(facts.holds)), "1"), "share": Value(0.01 * share, "1")}
    return Finding(f"held_poses_{name}", "warning", sentence, UNSEEN, values)


def _rate(name: str, facts: StreamFacts) -> Finding | None:
    count = WINDOW / facts.source_period
    if count > ENOUGH:
        return None
    rate = 1.0 / facts.source_period
    sentence = (
        f"The {name} has {rate:.3g} poses a second, {count:.1f} in a window of {WINDOW:g} s: begin and end of a push "
        f"are uncertain by a part of {1e3 * facts.source_period:.0f} ms."
    )
    advice = f"At least {FEWEST_SAMPLES / WINDOW:.0f} Hz are needed; 100 Hz are usual."
    severity: Severity = "refused" if count < FEWEST_SAMPLES - 0.5 else "warning"
    return Finding(f"rate_{name}", severity, sentence, advice, {"rate": Value(rate, "Hz")})


def _noise(name: str, facts: StreamFacts) -> Finding | None:
    if facts.coarse or max(facts.noise, LEVER * facts.heading_noise) < NOISY:
        return None
    sentence = f"The {name}'s poses have noise of {1e3 * facts.noise:.2g} mm"
    if facts.heading_noise > 0.0:
        sentence += f" and {np.degrees(facts.heading_noise):.2g} degrees"
    sentence += (
        f" (standard deviation): an observed displacement is uncertain by {1e3 * np.sqrt(2.0) * facts.noise:.2g} mm."
    )
    values = {"noise": Value(facts.noise, "m"), "heading_noise": Value(facts.heading_noise, "rad")}
    advice = "A model learns this as spread of the outcome. Use a tracker of less noise, or larger markers."
    return Finding(f"noise_{name}", "warning", sentence, advice, values)


def _speed_noise(facts: StreamFacts) -> Finding | None:
    """Of the tip: a window's velocity is the slope of a line through few samples."""
    count = max(FIT_SAMPLES, 1.0 + FIT_SPAN / facts.source_period)
    noise = facts.noise / (facts.source_period * np.sqrt(count * (count**2 - 1.0) / 12.0))
    if facts.coarse or noise < SPEED_NOISE:
        return None
    sentence = f"Noise of {1e3 * facts.noise:.2g} mm makes the tip's speeds uncertain by {1e3 * noise:.0f} mm/s."
    advice = "Take the tip's pose from the robot's joints in place of a camera, or filter it without delay."
    severity: Severity = "warning" if noise < TOO_NOISY else "refused"
    return Finding("speed_noise", severity, sentence, advice, {"speed": Value(float(noise), "m/s")})


# --- what a stream of poses is by itself ------------------------------------------------------------------------------


@dataclass(frozen=True)
class StreamFacts:
    """A stream of poses in its own stamps.

    period: median interval of the stamps, s; source_period: of the poses behind them, the same unless the stream
    repeats them. quantum: resolution of the positions (m), heading_quantum (rad), 0 where it is unknown. fit_span: the
    span (s) that lines need for a speed in this resolution. noise (m), heading_noise (rad): standard deviations of a
    sample. lost: number of poses that were continued on a line; lines: how many of these. held: number of stale poses;
    holds: how long, beyond the usual interval, each was held, s.
    """

    samples: int
    period: float
    source_period: float
    quantum: float
    heading_quantum: float
    fit_span: float
    noise: float
    heading_noise: float
    lost: int
    lines: int
    held: int
    holds: tuple[float, ...]

    @property
    def slower_source(self) -> bool:
        """Whether the poses come from a source that is slower than the messages."""
        return self.source_period > self.period

    @property
    def coarse(self) -> bool:
        """Whether the resolution is too coarse for the speed over the first 20 ms of a window."""
        return self.fit_span > SHORTEST


def pose_facts(stream: PoseStream, angle: bool) -> tuple[StreamFacts, PoseStream]:
    """The facts of a stream of at least two poses, and the stream as windows repair it; angle: whether headings count.

    The stamps must increase.
    """
    column = 3 if angle else None
    tilt = np.zeros(len(stream)) if stream.tilt is None else stream.tilt
    values = np.column_stack([stream.x, stream.y, stream.z, np.unwrap(stream.heading), tilt])
    quanta = Resolution(2 + angle).take(lengths(values, column))
    quantum = float(np.max(quanta[-1]))
    continued, held = ContinuedPoses(column), HeldPoses(column)
    samples = uninterrupted(stream.stamp, np.column_stack([values, np.max(quanta, axis=1)]))
    samples = continued.take(samples, final=True)
    if bursts := in_bursts(samples.stamp):
        samples = RegularStamps().take(samples, final=True)
    values, pose = samples.values, lengths(samples.values, column)
    period = usual_interval(samples.stamp)
    samples = SmoothedPoses(column).take(held.take(samples, final=True), final=True)
    source_period = _source_period(pose, quantum, period, len(held.dropouts))
    measured = values[changes(pose)] if source_period > period else values
    noise = noise_of(measured[:, [0, 1, 3]], order=3)  # of third differences: motion hardly changes them
    facts = StreamFacts(
        samples=len(stream),
        period=period,
        source_period=source_period,
        quantum=float(np.max(quanta[-1, :2])),
        heading_quantum=float(quanta[-1, 2] / LEVER) if angle else 0.0,
        fit_span=float(fit_span(quantum, period)),
        noise=float(max(*noise[:2], np.max(quanta[-1, :2]) / ROUNDED)),
        heading_noise=float(noise[2]) if angle else 0.0,
        lost=continued.lost,
        lines=continued.runs,
        held=held.stale,
        holds=tuple(held.dropouts),
    )
    if not (bursts or held.stale or facts.coarse or facts.lines >= FEWEST_RUNS):
        return facts, stream
    x, y, z, heading, tilt, _ = samples.values.T
    tilted = None if stream.tilt is None else tilt
    return facts, replace(stream, stamp=samples.stamp, x=x, y=y, z=z, heading=heading, tilt=tilted)


def in_bursts(stamp: IntArray) -> bool:
    """Whether most blocks of a stream are of a regular capture with stamps in bursts."""
    blocks = stamp[: len(stamp) // DECIDING * DECIDING].reshape(-1, DECIDING)
    found = [burst_period(block) is not None for block in blocks]
    return bool(found) and float(np.mean(found)) >= LEAST_BURSTS


def _source_period(pose: Array, quantum: float, period: float, holds: int) -> float:
    """The mean interval (s) of new poses in motion, where many of them are repeated; else the period."""
    if len(pose) <= 2 * AROUND:
        return period
    way = np.linalg.norm(pose[2 * AROUND :] - pose[: -2 * AROUND], axis=1) / (2 * AROUND)
    moving = way > np.maximum(STEPS * quantum, LEAST_WAY)
    again = np.all(pose[1:] == pose[:-1], axis=1)[AROUND - 1 : -AROUND]
    count = int(np.sum(moving))
    share = float(np.mean(again[moving])) if count else 0.0
    runs = int(np.sum(again[1:] & ~again[:-1] & moving[1:]))
    if holds > MOST_HOLDS * runs:  # single losses, not a slow source
        return period
    return period / (1.0 - share) if count >= FEWEST_MOVING and LEAST_SHARE < share < 1.0 else period
