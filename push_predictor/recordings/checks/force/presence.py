# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whether the force is there in the contacts: a stream that ends, has gaps, or stays at one value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.motion import Motion
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.streams import Recording, WrenchStream, taken
from push_predictor.types import Array, BoolArray

MISSING = 0.05  # share of the contacts
STUCK = 1.0  # s at exactly one value, in a contact and away from it
DRIVER = "Check the sensor's driver and cable."
BY_GEOMETRY = "Windows there come from the geometry alone and have no force."


def presence_findings(recording: Recording, motion: Motion) -> tuple[list[Finding], Recording]:
    """Findings about a force that is missing or stuck, and the recording without the samples that are stuck."""
    wrench = recording.wrench
    if wrench is None or not motion.contact.any():
        return [], recording
    time = (wrench.stamp - recording.slider.stamp[0]) * NANOSECOND
    missing, stuck = _missing(motion), _stuck(time, np.column_stack([wrench.fx, wrench.fy]), motion)
    if stuck.any():
        recording = replace(recording, wrench=taken(wrench, ~stuck))
    return [each for each in (missing, _stuck_finding(time, stuck, wrench)) if each is not None], recording


def _missing(motion: Motion) -> Finding | None:
    known = np.isfinite(motion.force[:, 0])
    share = 1.0 - float(np.mean(known[motion.contact]))
    if share <= MISSING:
        return None
    where, whole = "it has gaps or NaN", motion.time[-1]
    if known.any():
        begin, end = motion.time[known][[0, -1]]
        if begin > MISSING * whole:
            where = f"it begins {begin:.0f} s after the slider's poses"
        elif end < (1.0 - MISSING) * whole:
            where = f"it ends after {end:.0f} s of {whole:.0f} s"
    sentence = f"The force is missing in {100.0 * share:.0f} % of the contacts: {where}."
    return Finding("wrench_missing", "warning", sentence, f"{DRIVER} {BY_GEOMETRY}", {"share": Value(share, "1")})


def _stuck(time: Array, force: Array, motion: Motion) -> BoolArray:
    """Which samples (w,) of a force (w, 2) repeat one value for over STUCK, through two pushes; time (w,) s.

    A force of 0 throughout is absent.
    """
    if not len(time):
        return np.zeros(0, dtype=np.bool_)
    run = np.concatenate([[0], np.cumsum((np.diff(force, axis=0) != 0.0).any(axis=1))])
    first, last = (np.searchsorted(run, np.arange(run[-1] + 1), side=side) for side in ("left", "right"))
    found = np.zeros(len(run), dtype=np.bool_)
    for k in np.flatnonzero(time[last - 1] - time[first] > STUCK):
        within = motion.contact & (motion.time >= time[first[k]]) & (motion.time <= time[last[k] - 1])
        if force[first[k]].any() and len(np.unique(motion.push[within])) > 1:
            found[first[k] : last[k]] = True
    return found


def _stuck_finding(time: Array, stuck: BoolArray, wrench: WrenchStream) -> Finding | None:
    if not stuck.any():
        return None
    first, share = int(np.argmax(stuck)), float(np.mean(stuck))
    sentence = (
        f"The force stays at exactly ({wrench.fx[first]:.3g}, {wrench.fy[first]:.3g}) N in and out of contact, in "
        f"{100.0 * share:.0f} % of its samples, first after {time[first]:.0f} s."
    )
    return Finding("wrench_constant", "warning", sentence, f"{DRIVER} {BY_GEOMETRY}", {"share": Value(share, "1")})
