# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The streams by themselves: stamps, rates, resolution, repeats and units."""

from __future__ import annotations

from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.units import stream_units
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.regular_stamps import stamp_noise

STAMPS = "Windows use regular stamps in their place. Better: stamp each sample when it is measured, not at receipt."


def stream_stage(evidence: Evidence) -> Evidence:
    """What each stream shows by itself. Wrong units hide all that follows."""
    recording, rig = evidence.recording, evidence.rig
    if wrong_units := stream_units(recording, rig):
        return evidence.found(wrong_units)
    return evidence.found(_stamp_findings(recording))


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
