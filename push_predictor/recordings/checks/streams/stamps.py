# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Stamps that were never set, belong to clocks that never meet, or have jitter or bursts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.dropouts import NANOSECOND, longest_interval
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.windows.regular_stamps import (
    DECIDING,
    LEAST_TOGETHER,
    TOGETHER,
    RegularStamps,
    burst_period,
    stamp_noise,
)
from push_predictor.recordings.windows.stamp_order import uninterrupted
from push_predictor.types import IntArray

SECOND = 1_000_000_000  # ns
FEWEST = 10  # samples from which stamps are judged
SPAN = 3  # s of whole seconds in a stream, from which its fractions are judged
SMALL = 0.01  # of a second: no fraction of a stream over several seconds stays below
ZONE, SAME_ZONE = 1800 * SECOND, 0.04  # ns of which time zones differ; share of it in which the streams begin
EPOCH = 86400 * 365 * SECOND  # ns: an earlier time is counted from the start of a machine or a simulation
LOG = "`--stamp log` takes the recorder's time in place of the header's."
Stamps = dict[str, IntArray]
LEAST_BURSTS = 0.5  # of the blocks of a stream
LOST = 0.02  # share of the time in dropouts, from which irregular stamps are named
REGULAR = "Windows use regular stamps in their place."
BETTER = "Stamp each sample when it is measured, not at receipt."


def stamps_of(recording: Recording) -> Stamps:
    """The stamps of each stream with enough samples, by name."""
    return {name: stream.stamp for name, stream in recording.sensors.items() if len(stream) >= FEWEST}


def unset_stamps(stamps: Stamps) -> Finding | None:
    """A refusal if the stamps of streams do not say when a sample was measured."""
    wrong = {name: why for name, stamp in stamps.items() if (why := _wrong(stamp))}
    if not wrong:
        return None
    listed = ", ".join(f"{name} ({why})" for name, why in wrong.items())
    return Finding("stamps_unset", "refused", f"The header stamps do not tell the time: {listed}.", LOG)


def clocks_never_meet(stamps: Stamps) -> list[Finding]:
    """A refusal if a stream has no time in common with the slider's."""
    if "slider" not in stamps:
        return []
    first, last = int(stamps["slider"].min()), int(stamps["slider"].max())
    apart = {name: stamp for name, stamp in stamps.items() if stamp.max() < first or stamp.min() > last}
    if not apart:
        return []
    told = ", ".join(f"the {name}'s begin {_time(int(of.min()) - first)} the slider's" for name, of in apart.items())
    early = [name for name, of in {**apart, "slider": stamps["slider"]}.items() if of.max() < EPOCH]
    cause = (
        f" The time of {' and '.join(early)} counts from the start of a simulation or a machine."
        if 0 < len(early) <= len(apart)
        else ""
    )
    zones = {(int(of.min()) - first) / ZONE for of in apart.values()}
    if not cause and all(abs(each - round(each)) < SAME_ZONE for each in zones):
        cause = " These are whole half hours: the clocks are set to different time zones."
    sentence = f"The streams have no time in common, their stamps last {1e-9 * (last - first):.0f} s: {told}.{cause}"
    values = {f"{name}_apart": Value(1e-9 * (int(of.min()) - first), "s") for name, of in apart.items()}
    advice = f"Stamp all streams by one clock (`use_sim_time` for all nodes or for none). {LOG}"
    return [Finding("clocks_never_meet", "refused", sentence, advice, values)]


def _time(apart: int) -> str:
    """A time apart, ns, in words."""
    seconds = 1e-9 * abs(apart)
    size = f"{seconds:.0f} s" if seconds < 86400 else f"{seconds / 86400:.0f} days"
    return f"{size} {'after' if apart > 0 else 'before'}"


def _wrong(stamp: IntArray) -> str:
    """Why stamps (n,) ns do not say when a sample was measured, empty if they may."""
    first, last = int(stamp.min()), int(stamp.max())
    if first == last:
        return "all 0" if first == 0 else "all equal"
    fraction = stamp % SECOND
    seconds = len(np.unique(stamp // SECOND))
    if not fraction.any() and len(stamp) > 2 * seconds:
        return "whole seconds only"
    largest = int(fraction.max())
    if seconds >= SPAN and len(stamp) > 2 * seconds and 0 < largest < SMALL * SECOND:
        return f"the fraction of a second is about {10 ** round(np.log10(SECOND / largest)):g} times too small"
    return ""


# --- bursts and jitter ------------------------------------------------------------------------------------------------


def regular_in_bursts(stream: PoseStream) -> PoseStream:
    """The stream with the stamps that windows use, if its own are in bursts; its stamps must increase."""
    if not _in_bursts(stream.stamp):
        return stream
    rows = np.arange(len(stream), dtype=np.float64)[:, None]
    return replace(stream, stamp=RegularStamps().take(uninterrupted(stream.stamp, rows), final=True).stamp)


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
