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
from push_predictor.recordings.checks.streams.places import exchanged, places_of, two_bodies, without_flips
from push_predictor.recordings.checks.streams.poses import UNSEEN, StreamFacts, pose_facts, quality_findings
from push_predictor.recordings.checks.streams.stamps import (
    clocks_never_meet,
    regular_in_bursts,
    stamp_findings,
    stamps_of,
    unset_stamps,
)
from push_predictor.recordings.checks.units import has_heading, stream_rates, stream_units
from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.streams import PoseStream, Recording, Stream, repeated, taken
from push_predictor.recordings.windows.stamp_order import StampOrder
from push_predictor.recordings.windows.track import Track
from push_predictor.recordings.windows.unmeasured import continued

FEWEST_RUNS = 2
FEWEST = 10  # samples of a stream that has facts
LEAST_SHARE = 0.05  # of the samples are repeats; single ones are usual


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
    lost, sound = _without_continued(sound, headed)
    found += lost
    facts, sound = _facts(sound, headed)
    found += [*quality_findings(facts), *stamp_findings(stamps)]
    return evidence.found(found, sound)


def _without_continued(recording: Recording, headed: bool) -> tuple[list[Finding], Recording]:
    """Warnings about poses that a tracker continued while it did not see the body, and the recording without them."""
    found, sound = list[Finding](), dict[str, Any]()
    for name, stream in recording.poses.items():
        lost = continued(stream, headed and name == "slider")
        if (runs := int(np.sum(np.diff(lost, prepend=False) & lost))) < FEWEST_RUNS:
            continue
        sentence = (
            f"The {name}'s pose is continued on an exact line {runs} times, without the noise of a measurement: "
            f"{100.0 * float(lost.mean()):.1f} % of the samples are extrapolated."
        )
        values = {"runs": Value(float(runs), "1"), "share": Value(float(lost.mean()), "1")}
        found.append(Finding(f"continued_poses_{name}", "warning", sentence, UNSEEN, values))
        sound[name] = taken(stream, ~lost)
    return found, replace(recording, **sound) if sound else recording


def _facts(recording: Recording, headed: bool) -> tuple[dict[str, StreamFacts], Recording]:
    """The facts of the streams of poses, and the recording as repaired; headed: whether the slider has headings."""
    facts, repaired = dict[str, StreamFacts](), dict[str, Any]()
    for name, stream in recording.poses.items():
        if len(poses := in_order(stream)) < FEWEST:
            continue
        regular = regular_in_bursts(poses)
        facts[name], sound = pose_facts(regular, angle=headed and name == "slider")
        if sound is not regular or regular is not poses:  # others judge late samples: a clock that was set back
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
