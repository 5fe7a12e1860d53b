"""Faults of the streams, counted by kind: what each kind is called, and what it is."""

from __future__ import annotations

from collections.abc import Mapping

from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream

FAULTS = {
    "repeated": "samples whose stamp came before: not used",
    "late": "samples older than those that came before them: not used",
    "ahead": "samples whose stamp is ahead of those that follow: not used",
    "not_finite": "samples with a number that is none: not used",
    "jumps": "leaps of a position that nothing moves by: a sample that leaps there and back is not used",
    "dropouts": "gaps longer than 20 ms and four periods, in which no window lies",
    "refused": "samples not used for any of these",
    "resets": "times that the slider was put elsewhere, which ends a push",
    "clock_set_back": "times that the clock was set: windows before and after are kept apart",
    "not_a_push": "windows left out, the tip moves along or away",
    "inside": "times that the tip lay over 5 mm inside the slider: clocks or frames are apart",
    "left_behind": "windows left out, the tip went into a slider that did not give way: clocks or frames are apart",
    "outran": "windows left out, the slider went farther than the tip drove it",
}
# What no good system does. Slider resets, repeated stamps and short gaps are everyday.
WARNED = (
    "late",
    "ahead",
    "not_finite",
    "jumps",
    "clock_set_back",
    "inside",
    "left_behind",
    "outran",
)
APART = 0.25  # s that the clocks of two streams may differ before it is told


def fault_words(counts: Mapping[str, int]) -> list[str]:
    """In words, what kinds of fault occurred that a good system does not have; counts as of a WindowFinder."""
    return [f"{counts[kind]} {kind} ({FAULTS[kind]})" for kind in WARNED if counts.get(kind)]


def recording_faults(recording: Recording, counts: Mapping[str, int]) -> list[str]:
    """The same of a recording, with what only the whole of it tells: clocks that are apart, and no wrench."""
    found = fault_words(counts)
    if recording.wrench is None:
        found.append("no wrench was recorded: windows are found by geometry alone")
    for name, stream in (("pusher", recording.pusher), ("wrench", recording.wrench)):
        if stream is not None and abs(lag := clocks_apart(stream, recording.slider)) > APART:
            found.append(apart_words(name, lag))
    return found


def clocks_apart(stream: PoseStream | WrenchStream, slider: PoseStream) -> float:
    """By how much (s) a stream both begins and ends after (or before) the slider's: 0 unless it does both."""
    if not (len(stream) and len(slider)):
        return 0.0
    first, last = int(stream.stamp[0] - slider.stamp[0]), int(stream.stamp[-1] - slider.stamp[-1])
    return 1e-9 * min(first, last, key=abs) if first * last > 0 else 0.0


def apart_words(name: str, lag: float) -> str:
    """How the clock of a stream stands to the slider's."""
    return f"the stamps of the {name} are {abs(lag):.3g} s {'ahead of' if lag > 0 else 'behind'} those of the slider"
