# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The streams by themselves: stamps, repeats, jumps, units, rates, resolution and noise.

What other causes explain is no wrong unit: stamps that were never set, two bodies in one stream, flips of the heading.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from push_predictor.recordings.checks.finding import Evidence, Finding, Value
from push_predictor.recordings.checks.places import exchanged, places_of, two_bodies, without_flips
from push_predictor.recordings.checks.poses import StreamFacts, in_bursts, pose_facts, quality_findings
from push_predictor.recordings.checks.units import has_heading, stream_rates, stream_units
from push_predictor.recordings.dropouts import CLOCK_SET, NANOSECOND, longest_interval
from push_predictor.recordings.streams import PoseStream, Recording, Stream, repeated, taken
from push_predictor.recordings.windows.regular_stamps import (
    DECIDING,
    LEAST_TOGETHER,
    TOGETHER,
    stamp_noise,
)
from push_predictor.recordings.windows.stamp_order import StampOrder
from push_predictor.recordings.windows.track import Track
from push_predictor.types import IntArray

FEWEST = 10  # samples of a stream that is judged
LEAST_SHARE = 0.05  # of the samples are repeats; single ones are usual
SECOND = 1_000_000_000  # ns
SPAN = 3  # s of whole seconds in a stream, from which its fractions are judged
SMALL = 0.01  # of a second: no fraction of a stream over several seconds stays below
LOG = "`--stamp log` takes the recorder's time in place of the header's."
Stamps = dict[str, IntArray]
LOST = 0.02  # share of the time in dropouts, from which irregular stamps are named
REGULAR = "Windows use regular stamps in their place."
BETTER = "Stamp each sample when it is measured, not at receipt."


def stream_stage(evidence: Evidence) -> Evidence:
    """What each stream shows by itself. Wrong stamps and units hide all that follows."""
    recording, rig = evidence.recording, evidence.rig
    stamps = stamps_of(recording)
    if unset := unset_stamps(stamps):
        return evidence.found([unset])
    if wrong_times := stream_rates(recording) or clocks_never_meet(stamps):
        return evidence.found(wrong_times)
    found, sound = _jumps(recording)
    if any(finding.severity == "refused" for finding in found):
        return evidence.found(found)
    headed = has_heading(sound.slider)
    flips, sound = without_flips(sound, rig.outline) if headed else (None, sound)
    found += [] if flips is None else [flips]
    if flips is not None and flips.severity == "refused":
        return evidence.found(found)
    if wrong_units := stream_units(sound, rig):
        return evidence.found([*found, *wrong_units])
    facts, sound = _facts(sound, headed)
    found += [*quality_findings(facts), *stamp_findings(stamps)]
    return evidence.found(found, sound)


def _facts(recording: Recording, headed: bool) -> tuple[dict[str, StreamFacts], Recording]:
    """The facts of the streams of poses, and the recording as repaired; headed: whether the slider has headings."""
    facts, repaired = dict[str, StreamFacts](), dict[str, Any]()
    for name, stream in recording.poses.items():
        if len(poses := in_order(stream)) < FEWEST:
            continue
        facts[name], sound = pose_facts(poses, angle=headed and name == "slider")
        if sound is not poses:  # others judge late samples: a clock that was set back
            repaired[name] = sound
    return facts, replace(recording, **repaired) if repaired else recording


def _jumps(recording: Recording) -> tuple[list[Finding], Recording]:
    """What is twice or elsewhere in the streams, and the recording without it."""
    places = {name: places_of(stream) for name, stream in recording.poses.items()}
    swapped = exchanged(recording, places["slider"], places["pusher"])
    bodies = [two_bodies(name, of) for name, of in places.items()] if swapped is None else []
    found = [finding for finding in (repeated_samples(recording), swapped, *bodies) if finding is not None]
    if not found:
        return [], recording
    slider, pusher = (of_one_body(in_order(stream)) for stream in recording.poses.values())
    wrench = None if recording.wrench is None else in_order(recording.wrench)
    return found, replace(recording, slider=slider, pusher=pusher, wrench=wrench)


# --- the samples that are judged: of one setting of the clock, in order, each once ------------------------------------


def in_order(stream: Stream) -> Stream:
    """The longest part of a stream between settings of its clock, without samples older than one before."""
    begins = np.concatenate([[0], np.flatnonzero(np.diff(stream.stamp) < -CLOCK_SET) + 1, [len(stream)]])
    longest = int(np.argmax(np.diff(begins)))
    part = taken(stream, slice(int(begins[longest]), int(begins[longest + 1])))
    newest = np.maximum.accumulate(part.stamp)
    newer = np.append(True, part.stamp[1:] > newest[:-1])[: len(part)]
    return part if newer.all() else taken(part, newer)


def of_one_body(stream: PoseStream) -> PoseStream:
    """The samples of a stream without those that jump away and back, as the window finder takes them."""
    order = StampOrder(3, Track(3, position=True).is_jump)
    rows = np.column_stack([stream.x, stream.y, np.arange(len(stream), dtype=np.float64)])
    return taken(stream, order.take(stream.stamp, rows, final=True).values[:, 2].astype(np.int64))


def repeated_samples(recording: Recording) -> Finding | None:
    """A warning if samples are in the recording twice: from two publishers, or from a loop that was recorded."""
    streams = recording.sensors
    twice = {name: repeated(stream) for name, stream in streams.items() if len(stream)}
    often = {name: again for name, again in twice.items() if np.mean(again) > LEAST_SHARE}
    if not often:
        return None
    listed = ", ".join(f"{name} {100.0 * np.mean(again):.0f} %" for name, again in often.items())
    values = {f"{name}_share": Value(float(np.mean(again)), "1") for name, again in often.items()}
    sentence = f"Samples are recorded twice, with the same stamp and value: {listed}."
    if any(bool(np.any(np.diff(streams[name].stamp) < -CLOCK_SET)) for name in often):
        advice = "A loop was recorded. Its windows count once. Record a replay only once."
        return Finding("loop_recorded", "warning", sentence, advice, values)
    advice = "They count once. Stop the second publisher (`ros2 topic info --verbose` lists both)."
    return Finding("sent_twice", "warning", sentence, advice, values)


# --- stamps that were never set, belong to clocks that never meet, or have jitter or bursts ---------------------------


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
    late = {name: int(of.min()) - first for name, of in stamps.items() if of.max() < first or of.min() > last}
    if not late:
        return []
    told = ", ".join(
        f"the {name}'s begin {1e-9 * abs(apart):.0f} s {'after' if apart > 0 else 'before'} the slider's"
        for name, apart in late.items()
    )
    sentence = (
        f"The streams have no time in common, their stamps last {1e-9 * (last - first):.0f} s: {told}. They are of two "
        "clocks, as of simulation and wall time, or of two time zones."
    )
    values = {f"{name}_apart": Value(1e-9 * apart, "s") for name, apart in late.items()}
    advice = f"Stamp all streams by one clock (`use_sim_time` for all nodes or for none). {LOG}"
    return [Finding("clocks_never_meet", "refused", sentence, advice, values)]


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
    if together < LEAST_TOGETHER or (not (regular := in_bursts(stamp)) and lost < LOST):
        return None
    sentence = (
        f"The {name}'s stamps come in bursts: {100.0 * together:.0f} % of the intervals are under a quarter of their "
        f"mean, {1e3 * mean:.0f} ms."
    )
    if not regular:
        sentence += f" {100.0 * lost:.0f} % of the time are gaps, which no window spans."
    return Finding("stamp_bursts", "warning", sentence, f"{REGULAR} {BETTER}" if regular else BETTER, values)


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
