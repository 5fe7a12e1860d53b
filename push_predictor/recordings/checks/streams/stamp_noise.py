# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Jitter and bursts of the stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.streams.stamps import Stamps
from push_predictor.recordings.dropouts import NANOSECOND, longest_interval
from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.repairs.bursts import LEAST_TOGETHER, TOGETHER, burst_period
from push_predictor.recordings.windows.repairs.regular_stamps import DECIDING, RegularStamps, stamp_noise
from push_predictor.recordings.windows.stamp_order import OrderedSamples
from push_predictor.types import IntArray

LEAST_BURSTS = 0.5  # of the blocks of a stream
LOST = 0.02  # share of the time in dropouts, from which irregular stamps are named
REGULAR = "Windows use regular stamps in their place."
BETTER = "Stamp each sample when it is measured, not at receipt."


def regular_in_bursts(stream: PoseStream) -> PoseStream:
    """The stream with the stamps that windows use, if its own are in bursts; its stamps must increase."""
    if not _in_bursts(stream.stamp):
        return stream
    rows = np.arange(len(stream), dtype=np.float64)[:, None]
    samples = OrderedSamples(stream.stamp, rows, np.zeros(len(stream), dtype=np.bool_), False)
    return replace(stream, stamp=RegularStamps().take(samples, final=True).stamp)


def stamp_findings(stamps: Stamps) -> list[Finding]:
    """Findings about streams with stamps in bursts, and with other jitter; empty without any."""
    bursts = {name: found for name, stamp in stamps.items() if (found := _burst_finding(name, stamp)) is not None}
    jitter = _jitter_finding({name: stamp for name, stamp in stamps.items() if name not in bursts})
    return [*bursts.values(), *([] if jitter is None else [jitter])]


def _burst_finding(name: str, stamp: IntArray) -> Finding | None:
    step = np.diff(stamp) * NANOSECOND
    step = step[step > 0.0]
    if len(step) < DECIDING:
        return None
    mean = float(np.mean(np.minimum(step, np.percentile(step, 99.0))))
    together = float(np.mean(step < TOGETHER * mean))
    lost = float(np.sum(step[step > longest_interval(mean)]) / np.sum(step))
    values = {"together": Value(together, "1"), "lost": Value(lost, "1")}
    if together < LEAST_TOGETHER or (not (regular := _in_bursts(stamp)) and lost < LOST):
        return None
    sentence = (
        f"The {name}'s stamps come in bursts: {100.0 * together:.0f} % of the intervals are under a quarter of their "
        f"mean, {1e3 * mean:.0f} ms."
    )
    if not regular:
        sentence += f" {100.0 * lost:.0f} % of the time are gaps, which no window spans."
    return Finding("stamp_bursts", "warning", sentence, f"{REGULAR} {BETTER}" if regular else BETTER, values)


def _in_bursts(stamp: IntArray) -> bool:
    """Whether most blocks of a stream are of a regular capture with stamps in bursts."""
    blocks = stamp[: len(stamp) // DECIDING * DECIDING].reshape(-1, DECIDING)
    found = [burst_period(block) is not None for block in blocks]
    return bool(found) and float(np.mean(found)) >= LEAST_BURSTS


def _jitter_finding(stamps: Stamps) -> Finding | None:
    """A note on streams whose stamps the window finder replaces by regular ones."""
    noise = {name: stamp_noise(stamp) for name, stamp in stamps.items()}
    noisy = {name: each for name, each in noise.items() if each is not None and each.corrected}
    if not noisy:
        return None
    listed = ", ".join(
        f"{name} {1e3 * each.jitter:.2g} ms ({100.0 * each.jitter / each.period:.0f} % of the period)"
        for name, each in noisy.items()
    )
    values = {f"{name}_jitter": Value(each.jitter, "s") for name, each in noisy.items()}
    sentence = f"The stamps have jitter (standard deviation): {listed}."
    return Finding("stamp_jitter", "note", sentence, f"{REGULAR} Better: {BETTER[0].lower()}{BETTER[1:]}", values)
