# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The force against the motion: whether it is there, its zero, its clock, its unit, its sign and its axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.finding import Evidence, Finding, Value
from push_predictor.recordings.checks.force_direction import FEWEST_PUSHES, TOPIC, direction_findings
from push_predictor.recordings.checks.geometry import MIRRORS
from push_predictor.recordings.checks.motion import Motion, motion_of
from push_predictor.recordings.dropouts import NANOSECOND, usual_interval
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording, WrenchStream, taken
from push_predictor.recordings.windows.contact import SLOWEST
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.force import DOUBT, LATEST, force_delay
from push_predictor.recordings.windows.force import FEWEST as FEWEST_TOUCHES
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
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
MISSING = 0.05  # share of the contacts
STUCK = 1.0  # s at exactly one value, in a contact and away from it
DRIVER = "Check the sensor's driver and cable."
BY_GEOMETRY = "Windows there come from the geometry alone and have no force."
LOWEST_RATE = 1.0 / SLOWEST  # Hz: four samples in a window of 0.2 s
PARTS = 3  # of a recording, of which the first and the last show a drift
OF_ANOTHER_TIME = "Windows come from the geometry then, but their forces are those of another time."


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
        motion = motion_of(kept, rig) or motion
    found += [each for each in (rate_finding(recording.wrench), late) if each is not None]
    directed = not evidence.has(*MIRRORS, "frames_apart")
    found += wrench_findings(motion, rig, outlined, directed)
    return replace(evidence.found(found or [unseen_finding(delays)], kept), windows=windows)


def wrench_findings(motion: Motion, rig: Rig, outlined: bool = True, directed: bool = True) -> list[Finding]:
    """Findings about the zero, unit and axes of the wrench; empty without one.

    outlined: whether the outline shows where the tip is in contact. directed: whether slider and tip have one world
    frame, so that directions show axes.
    """
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


# --- whether it is there: a stream that ends, has gaps, or stays at one value -----------------------------------------


def presence_findings(recording: Recording, motion: Motion) -> tuple[list[Finding], Recording]:
    """Findings about a force that is missing or stuck, and the recording without the samples that are stuck."""
    if (wrench := recording.wrench) is None or not motion.contact.any():
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
    begin, end = motion.time[known][[0, -1]] if known.any() else (0.0, 0.0)
    sentence = (
        f"The force is missing in {100.0 * share:.0f} % of the contacts: it begins after {begin:.0f} s, ends after "
        f"{end:.0f} s of {motion.time[-1]:.0f} s, or has gaps or NaN."
    )
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


# --- its clock: when it rises against the touches that slider and tip show --------------------------------------------


def windows_and_delays(recording: Recording, rig: Rig) -> tuple[list[PushWindow], list[float]]:
    """The windows, and how late the force rises at each touch that slider and tip show, s; NaN where it does not."""
    finder = WindowFinder(rig)
    return finder.find(recording), [delay for _, delay in finder.force_touches]


def timing_finding(delays: list[float]) -> Finding | None:
    """A finding if the force is late or early, throughout or more and more."""
    size = len(delays) // PARTS
    whole, first, last = map(force_delay, (delays, delays[:size], delays[(PARTS - 1) * size : PARTS * size]))
    doubt = LATEST + DOUBT * float(np.hypot(first.sd, last.sd))
    changes = min(first.touches, last.touches) >= FEWEST_TOUCHES and abs(last.value - first.value) > doubt
    if not (whole.shifted or (changes and (first.shifted or last.shifted))):
        return None
    side = "after" if whole.value > 0.0 else "before"
    sentence = (
        f"The force rises {1e3 * abs(whole.value):.0f} ms {side} the touch that slider and tip show (sd "
        f"{1e3 * whole.sd:.2g} ms, {whole.touches} touches)."
    )
    if changes:
        sentence += f" Its delay changes from {1e3 * first.value:.0f} to {1e3 * last.value:.0f} ms."
    advice = f"Synchronise the clocks (chrony, PTP), and record the force without a filter. {OF_ANOTHER_TIME}"
    return Finding("wrench_lag", "warning", sentence, advice, {"lag": Value(whole.value, "s", whole.sd)})


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
    usual = usual_interval(wrench.stamp)
    rate = 1.0 / usual if usual else 0.0
    if rate >= LOWEST_RATE:
        return None
    sentence = (
        f"The force is sampled at {rate:.3g} Hz: below {LOWEST_RATE:g} Hz it shows neither when a contact begins nor "
        "the mean force of a window."
    )
    advice = "Record the wrench at 50 Hz or more, or use `--wrench-topic none`."
    return Finding("wrench_rate", "warning", sentence, advice, {"rate": Value(rate, "Hz")})
