# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of the streams by kind: names, descriptions, and warnings in words."""

from __future__ import annotations

from collections.abc import Mapping

from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream

_CHECK = "Check clock synchronisation and the outline's frame"
FAULTS = {
    "repeated": "samples with the stamp of an earlier sample; discarded",
    "late": "samples older than those received before them; discarded",
    "ahead": "samples with a stamp ahead of those that follow; discarded",
    "not_finite": "samples that contain NaN or infinity; discarded",
    "jumps": "position changes that no motion explains; a sample that jumps away and back is discarded",
    "dropouts": "gaps longer than 20 ms and four sample periods; no window spans them",
    "refused": "samples discarded for any of these reasons",
    "resets": "times that the slider was repositioned; each ends a push",
    "clock_set_back": "times that the clock was set; windows before and after are kept separate",
    "not_a_push": "windows rejected because the tip moves along the outline or away from it",
    "inside": f"times that the tip was more than 5 mm inside the outline. {_CHECK}",
    "left_behind": f"windows rejected because the tip enters the outline. {_CHECK}",
    "outran": f"windows rejected because the slider moved farther than the tip. {_CHECK}",
}
# A sound system has none of these. Resets, repeated stamps and short dropouts are normal.
WARNED = ("late", "ahead", "not_finite", "jumps", "clock_set_back", "inside", "left_behind", "outran")
CLOCK_TOLERANCE = 0.25  # s; larger clock offsets between two streams are reported


def describe_faults(counts: Mapping[str, int]) -> list[str]:
    """Sentences about the faults that a sound system does not have, from the counts of a WindowFinder."""
    return [f"{counts[kind]} {FAULTS[kind]}" for kind in WARNED if counts.get(kind)]


def describe_recording_faults(recording: Recording, counts: Mapping[str, int]) -> list[str]:
    """The same for a whole recording, with clock offsets between its streams and a missing wrench."""
    found = describe_faults(counts)
    if recording.wrench is None:
        found.append("no wrench was recorded: contact is found from geometry alone")
    for name, stream in recording.sensors.items():
        if abs(offset := clock_offset(stream, recording.slider)) > CLOCK_TOLERANCE:
            found.append(describe_clock_offset(name, offset))
    return found


def clock_offset(stream: PoseStream | WrenchStream, slider: PoseStream) -> float:
    """Time (s) by which a stream both begins and ends after (or before) the slider's.

    It is 0 unless the stream does both.
    """
    if not (len(stream) and len(slider)):
        return 0.0
    first, last = int(stream.stamp[0] - slider.stamp[0]), int(stream.stamp[-1] - slider.stamp[-1])
    return 1e-9 * min(first, last, key=abs) if first * last > 0 else 0.0


def describe_clock_offset(name: str, offset: float) -> str:
    """A sentence about the clock of a stream relative to the slider's; offset in s, positive if ahead."""
    side = "ahead of" if offset > 0 else "behind"
    return f"the stamps of the {name} are {abs(offset):.3g} s {side} those of the slider"
