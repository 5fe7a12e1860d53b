# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The force against the motion of the tip: whether it belongs to it, its unit, its sign and its axes.

The slider resists: its force on the tip points against the tip's velocity, up to the angle of the push and the friction
cone. A force along the slider's axes resists too while the slider turns little, but its direction in the slider's frame
then changes with the heading, which friction does not know.
"""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.motion import Motion, body_velocity, sums_by_push
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array, BoolArray, IntArray

LEAST_FORCE = 0.3  # N
LIGHT = 0.05  # of the slider's weight, where that is less: the force of a light slider
FAINTEST = 0.1  # N: what sensors resolve
FEWEST = 20  # samples
FEWEST_FREE = 5  # samples of a tip away from the slider
AWAY = 0.004  # m from the outline: the tip of a sound rig touches nothing there
LOOSE = 0.5  # of the force in contact: a force that is as large in free motion belongs to something else
ABSENT = 0.2  # share of the contacts with a force
FAINT, STEADY = 0.1, 0.8  # share of the large forces; share of the contacts
SOUND = 0.5  # mean cosine between the force and the direction against the motion, or against the contact's normal
UNRELATED = 0.4  # a mean cosine below, while no other reading of the force is sound
CLEAR = 0.3  # by which another reading of the force must agree better
FRICTION = (0.01, 3.0)  # of the force over the slider's weight: no surface has less or more
FRICTION_FACTOR = 5.0  # the force over that of the known friction, or its inverse
GRAVITY = 9.81  # m/s^2
FEWEST_PUSHES = 8  # for a standard deviation of the slope over headings
DOUBT = 4.0  # standard deviations
CONE = 0.5  # tangent of an angle beyond which contacts slide
ROUNDS, OUTLYING = 10, 0.05  # of the robust regression; rad
SIGN = "Give the force of the slider on the pusher: change the sign."
AXES = "Give the force along the world's axes, or state the sensor's: --wrench-frame tip or FRAME."
TOPIC = "Check the wrench topic, its stamps and its zero."


def force_stage(evidence: Evidence) -> Evidence:
    """Whether the force belongs to the motion: its zero, sign, axes and unit."""
    outlined = all(finding.severity == "note" for finding in evidence.findings)
    return evidence.found(wrench_findings(evidence.motion, evidence.rig, outlined))


def wrench_findings(motion: Motion | None, rig: Rig, outlined: bool = True) -> list[Finding]:
    """Findings about the wrench; empty without one. outlined: whether the outline shows where the tip is in contact."""
    if motion is None:
        return []
    size = np.hypot(*motion.force.T)
    contact = motion.contact & np.isfinite(size)
    if np.sum(contact) < FEWEST:
        return []
    least = _least_force(rig)
    loose = _loose(motion, size, contact, rig) if outlined else None
    if found := loose or _absent(size[contact], least) or _scale(size[contact], rig):
        return [found]
    used = contact & (size > least)
    return _directions(motion, used, rig, _steady(size[contact])) if np.sum(used) >= FEWEST else []


def _least_force(rig: Rig) -> float:
    if rig.object_mass is None:  # the slider may be light
        return FAINTEST
    return max(FAINTEST, min(LEAST_FORCE, LIGHT * GRAVITY * rig.object_mass))


def _loose(motion: Motion, size: Array, contact: BoolArray, rig: Rig) -> Finding | None:
    """A finding if the force is there without contact too: constant, of another time, or of another body."""
    apart = rig.outline.project(to_body(motion.tip, motion.slider)).distance - rig.pusher_radius > AWAY
    free = apart & np.isfinite(size)
    if np.sum(free) < FEWEST_FREE:
        return None
    loose, touching = float(np.median(size[free])), float(np.median(size[contact]))
    if loose < max(LOOSE * touching, LEAST_FORCE):
        return None
    sentence = f"The force is {loose:.2g} N while the tip is away from the slider, and {touching:.2g} N in contact."
    values = {"free_force": Value(loose, "N"), "force": Value(touching, "N")}
    return Finding("wrench_unrelated", "warning", sentence, TOPIC, values)


def _absent(size: Array, least: float) -> Finding | None:
    share = float(np.mean(size > least))
    if share > ABSENT:
        return None
    sentence = f"The force exceeds {least:.2g} N in {100.0 * share:.0f} % of the contacts only."
    advice = "Check that the sensor is on, that its topic is right, and that forces are in N."
    return Finding("wrench_absent", "warning", sentence, advice, {"share": Value(share, "1")})


def _scale(size: Array, rig: Rig) -> Finding | None:
    """A finding if no friction explains the force: the slider's weight times its friction moves it."""
    if rig.object_mass is None:
        return None
    force, weight = float(np.median(size)), GRAVITY * rig.object_mass
    lowest, highest = weight * np.array(FRICTION)
    if rig.surface_friction:
        known = weight * rig.surface_friction
        lowest, highest = max(lowest, known / FRICTION_FACTOR), min(highest, known * FRICTION_FACTOR)
    if lowest <= force <= highest:
        return None
    sentence = f"The force in contact is {force:.3g} N in the median, for a slider of {weight:.3g} N of weight."
    advice = "Give forces in N, torques in N m, and object_mass in kg."
    values = {"force": Value(force, "N"), "weight": Value(weight, "N")}
    return Finding("wrench_units", "warning", sentence, advice, values)


def _steady(size: Array) -> bool:
    """Whether nearly all contacts have a force; that of another time is missing in many."""
    return bool(np.mean(size > FAINT * np.percentile(size, 90.0)) > STEADY)


def _directions(motion: Motion, used: BoolArray, rig: Rig, steady: bool) -> list[Finding]:
    """Findings about sign and axes, from the direction of the force against that of the motion."""
    force, heading = motion.force[used] / np.linalg.norm(motion.force[used], axis=1)[:, None], motion.slider[used, 2]
    inward = -rig.outline.project(to_body(motion.tip, motion.slider)[used]).normal
    ahead = (motion.tip_velocity[used] / motion.tip_speed[used, None], rotate(inward, heading))
    now = _resistance(force, ahead)
    quarters = np.array([[0.0], [0.5], [1.0], [1.5]]) * np.pi
    turns = [*(heading + quarters), *quarters[[1, 3]]]
    readings = {
        "wrench_sign": (_resistance(-force, ahead), "Its sign is probably wrong.", SIGN),
        "wrench_frame": (
            max(_resistance(rotate(force, turn), ahead) for turn in turns),
            "Its axes are probably not the world's.",
            AXES,
        ),
    }
    name = "wrench_sign" if readings["wrench_sign"][0] > SOUND else max(readings, key=lambda each: readings[each][0])
    best, reason, advice = readings[name]
    if now > SOUND:
        return _turns_with_slider(motion, used, rig)
    values = {"cosine": Value(now, "1"), "cosine_after": Value(best, "1")}
    if not steady or best < max(now + CLEAR, SOUND):
        if now > UNRELATED:
            return []
        name, reason, advice = "wrench_unrelated", "It is probably of another time or body.", TOPIC
    sentence = f"The force does not resist the motion (mean cosine {now:.2f}, sound above {SOUND}). {reason}"
    return [Finding(name, "warning", sentence, advice, values)]


def _turns_with_slider(motion: Motion, used: BoolArray, rig: Rig) -> list[Finding]:
    """The slope of the force's angle to the normal over the slider's heading: 0, or -1 for the slider's axes."""
    push, heading = motion.push[used], wrap_angle(motion.slider[used, 2])
    if len(np.unique(push)) < FEWEST_PUSHES:
        return []
    normal = -rig.outline.project(to_body(motion.tip, motion.slider)[used]).normal
    force = _angle_between(rotate(-motion.force[used], -heading), normal)
    drive = _angle_between(body_velocity(motion)[used], normal)
    slope, sd = _slope(np.column_stack([heading, np.ones(len(push)), np.clip(np.tan(drive), -CONE, CONE)]), force, push)
    if not -1.5 < slope < -0.5 - DOUBT * sd:
        return []
    sentence = (
        f"The force turns against the contact's normal by {slope:.2f} rad (sd {sd:.2f}) per radian of the slider's "
        "heading, sound 0. Its axes are probably the slider's."
    )
    return [Finding("wrench_frame", "warning", sentence, AXES, {"slope": Value(slope, "1", sd)})]


def _angle_between(vectors: Array, normals: Array) -> Array:
    """Angles (n,) of vectors (n, 2), counter-clockwise from normals (n, 2)."""
    return wrap_angle(np.arctan2(vectors[:, 1], vectors[:, 0]) - np.arctan2(normals[:, 1], normals[:, 0]))


def _slope(inputs: Array, values: Array, push: IntArray) -> tuple[float, float]:
    """The first coefficient of a robust regression of values (n,) on inputs (n, k), and its sd over pushes."""
    weight = np.ones(len(values))
    for _ in range(ROUNDS):
        bread = np.linalg.pinv(inputs.T @ (weight[:, None] * inputs))
        coefficients = bread @ (inputs.T @ (weight * values))
        error = values - inputs @ coefficients
        weight = 1.0 / np.sqrt(1.0 + (error / OUTLYING) ** 2)
    scores = sums_by_push(inputs * (weight * error)[:, None], push)
    return float(coefficients[0]), float(np.sqrt((bread @ scores.T @ scores @ bread)[0, 0]))


def _resistance(force: Array, ahead: tuple[Array, Array]) -> float:
    """The mean cosine between the force and the opposite of the motion, or of the contact's normal: the larger one."""
    return max(-float(np.mean(np.sum(force * direction, axis=1))) for direction in ahead)
