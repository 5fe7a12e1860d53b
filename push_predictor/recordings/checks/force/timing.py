# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The clock of the force: when it rises against the touches that slider and tip show, and how often it is sampled."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.force.direction import TOPIC
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.windows.contact import SLOWEST
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.force_timing import DOUBT, FEWEST, LATEST, ForceDelay, force_delay
from push_predictor.recordings.windows.push_window import PushWindow

LOWEST_RATE = 1.0 / SLOWEST  # Hz: four samples in a window of 0.2 s
PARTS = 3  # of a recording, of which the first and the last show a drift
BY_GEOMETRY = "Windows come from the geometry then, but their forces are those of another time."


def windows_and_delays(recording: Recording, rig: Rig) -> tuple[list[PushWindow], list[float]]:
    """The windows, and how late the force rises at each touch that slider and tip show, s; NaN where it does not."""
    finder = WindowFinder(rig)
    return finder.find(recording), [delay for _, delay in finder.force_touches]


def timing_finding(delays: list[float]) -> Finding | None:
    """A finding if the force is late or early, throughout or more and more."""
    whole, first, last = force_delay(delays), *(_part(delays, k) for k in (0, PARTS - 1))
    changes = _changes(first, last)
    if not (whole.shifted or (changes and (first.shifted or last.shifted))):
        return None
    return _finding(whole, (first, last) if changes else None)


def unseen_finding(delays: list[float]) -> Finding | None:
    """A finding if the force does not rise at many touches."""
    delay = force_delay(delays)
    if not delay.apart:
        return None
    sentence = (
        f"The force does not rise at {100.0 * delay.missing:.0f} % of the {delay.touches} touches that slider and tip "
        "show. It is probably of another time or body."
    )
    return Finding("wrench_unrelated", "warning", sentence, TOPIC, {"missing": Value(delay.missing, "1")})


def rate_finding(wrench: WrenchStream) -> Finding | None:
    """A finding if the force is sampled too seldom to show when a contact begins."""
    step = np.diff(np.unique(wrench.stamp))
    rate = 1.0 / (float(np.median(step)) * NANOSECOND) if len(step) else 0.0
    if rate >= LOWEST_RATE:
        return None
    sentence = (
        f"The force is sampled at {rate:.3g} Hz: below {LOWEST_RATE:g} Hz it shows neither when a contact begins nor "
        "the mean force of a window."
    )
    advice = "Record the wrench at 50 Hz or more, or use `--wrench-topic none`."
    return Finding("wrench_rate", "warning", sentence, advice, {"rate": Value(rate, "Hz")})


def _part(delays: list[float], number: int) -> ForceDelay:
    size = len(delays) // PARTS
    return force_delay(delays[number * size : (number + 1) * size])


def _changes(first: ForceDelay, last: ForceDelay) -> bool:
    """Whether the delay at the end clearly differs from that at the start."""
    if min(first.touches, last.touches) < FEWEST:
        return False
    return abs(last.value - first.value) > LATEST + DOUBT * float(np.hypot(first.sd, last.sd))


def _finding(whole: ForceDelay, ends: tuple[ForceDelay, ForceDelay] | None) -> Finding:
    side = "after" if whole.value > 0.0 else "before"
    sentence = (
        f"The force rises {1e3 * abs(whole.value):.0f} ms {side} the touch that slider and tip show (sd "
        f"{1e3 * whole.sd:.2g} ms, {whole.touches} touches)."
    )
    if ends is not None:
        sentence += f" Its delay changes from {1e3 * ends[0].value:.0f} to {1e3 * ends[1].value:.0f} ms."
    advice = f"Synchronise the clocks (chrony, PTP), and record the force without a filter. {BY_GEOMETRY}"
    return Finding("wrench_lag", "warning", sentence, advice, {"lag": Value(whole.value, "s", whole.sd)})
