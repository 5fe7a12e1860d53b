# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Check a recording or a push table before anything is learnt from it."""

from __future__ import annotations

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.fixed_to_tip import fixed_to_tip
from push_predictor.recordings.checks.frames import frame_findings, tip_follows
from push_predictor.recordings.checks.table_signs import table_signs
from push_predictor.recordings.checks.units import orientation_finding, stream_units, table_units
from push_predictor.recordings.checks.wrench import wrench_findings
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.regular_stamps import stamp_noise

STAMPS = "Windows use regular stamps in their place. Better: stamp each sample when it is measured, not at receipt."


def check_recording(recording: Recording, rig: Rig) -> tuple[Finding, ...]:
    """The probable mistakes of a recording, none if it is sound. Wrong units hide the other mistakes."""
    if wrong_units := stream_units(recording, rig):
        return tuple(wrong_units)
    if held := fixed_to_tip(recording, rig):
        return (held,)
    oriented = orientation_finding(recording.slider)
    # A tip has a constant heading too: the exchange of topics explains more.
    if oriented is not None and oriented.severity == "refused" and not tip_follows(recording, rig):
        return (oriented,)
    frames = frame_findings(recording, rig)
    if any(finding.name == "topics_swapped" for finding in frames):
        return tuple(frames)
    if oriented is not None and oriented.severity == "refused":
        return (oriented,)
    if any(finding.severity == "refused" for finding in frames):
        return tuple(frames)
    found = frames if oriented is None else [oriented, *frames]
    outlined = all(finding.severity == "note" for finding in found)
    return (*found, *wrench_findings(recording, rig, outlined), *_stamp_findings(recording))


def check_table(table: PushTable, rig: Rig | None = None) -> tuple[Finding, ...]:
    """The probable mistakes of a push table, none if it is sound."""
    return tuple(table_units(table, rig) or table_signs(table, rig))


def _stamp_findings(recording: Recording) -> list[Finding]:
    """A note on streams whose stamps the window finder replaces by regular ones; empty without any."""
    streams = {"slider": recording.slider, "pusher": recording.pusher, "wrench": recording.wrench}
    noise = {name: stamp_noise(stream.stamp) for name, stream in streams.items() if stream is not None}
    noisy = {name: each for name, each in noise.items() if each is not None and each.corrected}
    if not noisy:
        return []
    listed = ", ".join(
        f"{name} {1e3 * each.jitter:.2g} ms ({100.0 * each.jitter / each.period:.0f} % of the period)"
        for name, each in noisy.items()
    )
    values = {f"{name}_jitter": Value(each.jitter, "s") for name, each in noisy.items()}
    return [Finding("stamp_jitter", "note", f"The stamps have jitter (standard deviation): {listed}.", STAMPS, values)]
