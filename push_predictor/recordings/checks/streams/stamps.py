# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Stamps that were never set, or belong to clocks that never meet."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.streams import Recording
from push_predictor.types import IntArray

SECOND = 1_000_000_000  # ns
FEWEST = 10  # samples from which stamps are judged
SPAN = 3  # s of whole seconds in a stream, from which its fractions are judged
SMALL = 0.01  # of a second: no fraction of a stream over several seconds stays below
ZONE, SAME_ZONE = 1800 * SECOND, 0.04  # ns of which time zones differ; share of it in which the streams begin
EPOCH = 86400 * 365 * SECOND  # ns: an earlier time is counted from the start of a machine or a simulation
LOG = "`--stamp log` takes the recorder's time in place of the header's."
Stamps = dict[str, IntArray]


def stamps_of(recording: Recording) -> Stamps:
    """The stamps of each stream with enough samples, by name."""
    streams = {"slider": recording.slider, "pusher": recording.pusher, "wrench": recording.wrench}
    return {name: stream.stamp for name, stream in streams.items() if stream is not None and len(stream) >= FEWEST}


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
