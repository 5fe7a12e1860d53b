# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""The jitter of the stamps: such as of stamps taken at receipt, in place of the time of the measurement."""

from __future__ import annotations

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.stamp_noise import StampNoise, stamp_noise

ADVICE = "Windows use regular stamps in their place. Better: stamp each sample when it is measured, not at receipt."


def stamp_findings(recording: Recording) -> list[Finding]:
    """A note on streams whose stamps the window finder replaces by regular ones; empty without any."""
    streams = {"slider": recording.slider, "pusher": recording.pusher, "wrench": recording.wrench}
    noise = {name: stamp_noise(stream.stamp) for name, stream in streams.items() if stream is not None}
    noisy = {name: each for name, each in noise.items() if each is not None and each.corrected}
    if not noisy:
        return []
    listed = ", ".join(f"{name} {_in_words(each)}" for name, each in noisy.items())
    values = {f"{name}_jitter": Value(each.jitter, "s") for name, each in noisy.items()}
    return [Finding("stamp_jitter", "note", f"The stamps have jitter (standard deviation): {listed}.", ADVICE, values)]


def _in_words(noise: StampNoise) -> str:
    return f"{1e3 * noise.jitter:.2g} ms ({100.0 * noise.jitter / noise.period:.0f} % of the period)"
