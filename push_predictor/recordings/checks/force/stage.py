# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The force against the motion: whether it is there, its zero, its clock, its unit, its sign and its axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.force.direction import FEWEST_PUSHES, TOPIC, direction_findings
from push_predictor.recordings.checks.force.presence import presence_findings
from push_predictor.recordings.checks.force.timing import (
    rate_finding,
    timing_finding,
    unseen_finding,
    windows_and_delays,
)
from push_predictor.recordings.checks.geometry.stage import MIRRORS
from push_predictor.recordings.checks.motion import Motion, motion_of
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array, BoolArray

LEAST_FORCE = 0.3  # N
LIGHT = 0.05  # of the slider's weight, where that is less: the force of a light slider
FAINTEST = 0.1  # N: what sensors resolve
FEWEST = 20  # samples
FEWEST_FREE = 5  # samples of a tip away from the slider
AWAY = 0.004  # m from the outline: the tip of a sound rig touches nothing there
BIASED = 0.3  # of the force in contact: a larger zero is named
CONSTANT, COVERED = 2.0, 80.0  # times the spread, a percentile: a zero is nearly the same throughout
LOOSE = 0.5  # of the force in contact, in the median
LARGER = 0.75  # share of pairs with more force in contact than away: 1 for a sound force, 0.5 for an unrelated one
ABSENT = 0.2  # share of the contacts with a force
FRICTION = (0.04, 3.0)  # of the force over the slider's weight: no surface has less or more
PLAUSIBLE = (0.08, 1.2)  # of the same: a unit with which it lies there is named
FRICTION_FACTOR = 3.0  # the force over that of the known friction, or its inverse
PUSHED = 75.0  # percentile: a noisy tracker takes some rest for contact
GRAVITY = 9.81  # m/s^2
UNITS = {"kN": 1e3, "kgf": 9.80665, "lbf": 4.44822, "gf": 9.80665e-3, "mN": 1e-3}  # N


def force_stage(evidence: Evidence) -> Evidence:
    """Whether the force belongs to the motion: it is there, and its zero, clock, unit, sign and axes are right."""
    recording, rig, motion = evidence.recording, evidence.rig, evidence.motion
    if recording.wrench is None or motion is None:
        return evidence
    outlined = all(finding.severity == "note" for finding in evidence.findings)
    found, kept = presence_findings(recording, motion)
    # A wrong outline shows touches elsewhere.
    windows, delays = windows_and_delays(kept, rig) if outlined else (None, [])
    windows = windows if kept is evidence.recorded else None
    late = timing_finding(delays)
    if late is not None and kept.wrench is not None:
        stamp = kept.wrench.stamp - round(late.values["lag"].value / NANOSECOND)
        kept = replace(kept, wrench=replace(kept.wrench, stamp=stamp))
    if kept is not recording:
        motion = motion_of(kept, rig)
    found += [each for each in (rate_finding(recording.wrench), late) if each is not None]
    directed = not evidence.has(*MIRRORS, "frames_apart")
    found += wrench_findings(motion, rig, outlined, directed)
    return replace(evidence.found(found or [unseen_finding(delays)], kept), windows=windows)


def wrench_findings(motion: Motion | None, rig: Rig, outlined: bool = True, directed: bool = True) -> list[Finding]:
    """Findings about the zero, unit and axes of the wrench; empty without one.

    outlined: whether the outline shows where the tip is in contact. directed: whether slider and tip have one world
    frame, so that directions show axes.
    """
    if motion is None:
        return []
    free = _free(motion, rig) if outlined else np.zeros(len(motion.time), dtype=np.bool_)
    zero, spread = _zero(motion.force[free])
    touching = motion.touching & np.isfinite(motion.force[:, 0])
    if np.sum(touching) < FEWEST:
        return []
    few = len(np.unique(motion.push[touching])) < FEWEST_PUSHES
    if few:  # they show another zero no better than another time
        zero = np.zeros(2)
    motion = replace(motion, force=motion.force - zero)
    size = np.hypot(*motion.force.T)
    if found := _loose(size[free], size[touching], few):
        return [found]
    biased = _biased(zero, spread, float(np.median(size[touching])))
    least = _least_force(rig)
    if found := _scale(size[touching], rig) or _absent(size[touching], least):
        return [*biased, found]
    if not directed:
        return biased
    used, radius = touching & (size > least), float(np.sqrt(rig.outline.polar_moment))
    return [*biased, *direction_findings(motion, used, radius)]


def _free(motion: Motion, rig: Rig) -> BoolArray:
    """Which samples (n,) have a force while the tip is away from the slider, or lifted."""
    gap = rig.outline.project(to_body(motion.tip, motion.slider)).distance - rig.pusher_radius
    away = (gap > AWAY) | (motion.tip_height > WindowOptions().lift)
    return np.asarray(away & np.isfinite(motion.force[:, 0]))


def _zero(free: Array) -> tuple[Array, float]:
    """The median force (2,) N of a tip without contact and its spread (N); zero and 0 if it is hardly known."""
    if len(free) < FEWEST_FREE:
        return np.zeros(2), 0.0
    zero = np.median(free, axis=0)
    return zero, float(np.percentile(np.hypot(*(free - zero).T), COVERED))


def _least_force(rig: Rig) -> float:
    if rig.object_mass is None:  # the slider may be light
        return FAINTEST
    return max(FAINTEST, min(LEAST_FORCE, LIGHT * GRAVITY * rig.object_mass))


def _loose(free: Array, contact: Array, few: bool) -> Finding | None:
    """A finding if the force is often as large without contact: it is of another time, or of another body.

    few: pushes, in which single samples do not count.
    """
    if len(free) < FEWEST_FREE:
        return None
    loose, touching = float(np.median(free)), float(np.median(contact))
    larger = float(np.mean(np.searchsorted(np.sort(free), contact) / len(free)))
    if loose < max(LOOSE * touching, LEAST_FORCE) if few else larger > LARGER or touching < FAINTEST:
        return None
    sentence = (
        f"The force differs from its zero by {loose:.2g} N away from the slider and by {touching:.2g} N "
        f"in contact, in the median. It is larger in contact in {100.0 * larger:.0f} % of all pairs of samples. It is "
        "probably of another time or body."
    )
    return Finding("wrench_unrelated", "warning", sentence, TOPIC, {"larger": Value(larger, "1")})


def _biased(zero: Array, spread: float, force: float) -> list[Finding]:
    size = float(np.hypot(*zero))
    if size < max(BIASED * force, LEAST_FORCE, CONSTANT * spread):
        return []
    x, y = zero
    sentence = (
        f"The force is ({x:.2f}, {y:.2f}) N along x and y while the tip is away from the slider: its zero is off. "
        f"Contact adds {force:.2g} N to it in the median."
    )
    advice = "Subtract it with `--wrench-bias free_motion`, or set the sensor to zero while the tip is lifted."
    values = {"bias_x": Value(float(x), "N"), "bias_y": Value(float(y), "N"), "force": Value(force, "N")}
    return [Finding("wrench_zero", "warning", sentence, advice, values)]


def _absent(size: Array, least: float) -> Finding | None:
    share = float(np.mean(size > least))
    if share > ABSENT:
        return None
    sentence = f"The force exceeds {least:.2g} N in {100.0 * share:.0f} % of the contacts only."
    advice = "Check that the sensor is on, that its topic is right, and that forces are in N."
    return Finding("wrench_absent", "warning", sentence, advice, {"share": Value(share, "1")})


def _scale(size: Array, rig: Rig) -> Finding | None:
    """A finding if no friction explains the force: the slider's weight times its friction moves it."""
    force = float(np.percentile(size, PUSHED))
    if rig.object_mass is None or force == 0.0:
        return None
    weight = GRAVITY * rig.object_mass
    lowest, highest = FRICTION
    plausible = PLAUSIBLE
    if known := rig.surface_friction:
        lowest, highest = max(lowest, known / FRICTION_FACTOR), min(highest, known * FRICTION_FACTOR)
        plausible = lowest, highest
    share = force / weight
    if lowest <= share <= highest:
        return None
    fitting = {unit: newton for unit, newton in UNITS.items() if plausible[0] <= share * newton <= plausible[1]}
    sentence = (
        f"The force in contact is about {force:.3g} N, {share:.2g} of the slider's weight of {weight:.3g} N: "
        f"friction makes it {lowest:.2g} to {highest:.2g}."
    )
    if fitting:
        sentence += f" Its unit is probably {' or '.join(fitting)}."
    factors = ", ".join(f"by {newton:.4g} if they are in {unit}" for unit, newton in fitting.items())
    advice = "Give forces in N" + (f": multiply them {factors}" if fitting else "")
    values = {"force": Value(force, "N"), "weight": Value(weight, "N")}
    return Finding("wrench_units", "warning", sentence, f"{advice}. Give object_mass in kg.", values)
