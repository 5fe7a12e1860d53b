# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The streams by themselves: stamps, repeats, jumps, units, rates, resolution and noise.

What other causes explain is no wrong unit: stamps that were never set, two bodies in one stream, flips of the heading.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.flips import without_flips
from push_predictor.recordings.checks.orientation import has_heading
from push_predictor.recordings.checks.places import exchanged, places_of, two_bodies
from push_predictor.recordings.checks.quality import quality_findings
from push_predictor.recordings.checks.session import in_order, of_one_body, repeated_samples
from push_predictor.recordings.checks.stamp_noise import regular_in_bursts, stamp_findings
from push_predictor.recordings.checks.stamps import clocks_never_meet, stamps_of, unset_stamps
from push_predictor.recordings.checks.stream_facts import StreamFacts, pose_facts
from push_predictor.recordings.checks.units import stream_rates, stream_units
from push_predictor.recordings.streams import Recording

FEWEST = 10  # samples of a stream that has facts


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
    found += [*quality_findings(facts), *stamp_findings(recording)]
    return replace(evidence.found(found, sound), facts=facts)


def _facts(recording: Recording, headed: bool) -> tuple[dict[str, StreamFacts], Recording]:
    """The facts of the streams of poses, and the recording as repaired; headed: whether the slider has headings."""
    facts, repaired = dict[str, StreamFacts](), dict[str, Any]()
    for name, stream in (("slider", recording.slider), ("pusher", recording.pusher)):
        if len(poses := regular_in_bursts(in_order(stream))) >= FEWEST:
            facts[name], repaired[name] = pose_facts(poses, angle=headed and name == "slider")
            if repaired[name] is stream:
                del repaired[name]
    return facts, replace(recording, **repaired) if repaired else recording


def _jumps(recording: Recording) -> tuple[list[Finding], Recording]:
    """What is twice or elsewhere in the streams, and the recording without it."""
    places = {name: places_of(getattr(recording, name)) for name in ("slider", "pusher")}
    swapped = exchanged(recording, places["slider"], places["pusher"])
    bodies = [two_bodies(name, getattr(recording, name), of) for name, of in places.items()] if swapped is None else []
    found = [finding for finding in (repeated_samples(recording), swapped, *bodies) if finding is not None]
    if not found:
        return [], recording
    slider, pusher = (of_one_body(in_order(stream)) for stream in (recording.slider, recording.pusher))
    wrench = None if recording.wrench is None else in_order(recording.wrench)
    return found, replace(recording, slider=slider, pusher=pusher, wrench=wrench)
