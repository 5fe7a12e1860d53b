# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The axes of the force: its direction against that in which the slider's centre moves.

A pushed slider moves along the force on it, whatever side and angle it is pushed at: friction resists its motion, and
inertia is small. The limit surface of friction bends this by some degrees, one way or the other as the slider turns.
The angle between the two is that between the sensor's axes and the world's. It is constant if those are fixed, and it
changes with the heading of slider or tip if the sensor turns with them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.motion import Motion, mean_velocity, sums_by_push
from push_predictor.types import Array, BoolArray, IntArray

SPAN = 0.05  # s before and after a sample that determine its velocity
FEWEST = 20  # samples
FEWEST_PUSHES = 8  # for a standard deviation over pushes, and for the mean of what friction bends
TRANSLATING = 0.5  # of the motion of the slider's edge: it turns about a point so far off that its centre moves
ALLOWED = np.radians(8.0)  # beyond what friction bends the mean of many pushes
ALLOWED_FEW = np.radians(45.0)  # the same of few pushes
DOUBT = 4.0  # standard deviations
LEFT, DOUBT_FAR = 0.1, 2.0  # share of the spread that other axes leave, and doubt that suffices then
RELATED = 0.5  # mean resultant length, 1 if all angles agree, 0 if they are random
ROUNDS, OUTLYING = 10, 0.05  # of the robust regression; rad
WORLD, MIRROR, SLIDER, TIP = "world", "mirror", "slider", "tip"

SIGN = "Give the force of the slider on the pusher: change the sign."
TOPIC = "Check the wrench topic and its stamps."


@dataclass(frozen=True, eq=False)
class Reading:
    """The sensor's axes if they are fixed to something: angles (n,) from the force to the motion, rad.

    turn: their mean, with its sd over pushes; length: mean resultant length, as in RELATED.
    """

    axes: str
    angles: Array
    turn: float
    sd: float
    length: float


def direction_findings(motion: Motion, used: BoolArray, radius: float) -> list[Finding]:
    """Findings about sign and axes of the force, none if they are sound.

    used (n,): samples in contact with a force, of which the zero is subtracted. radius: gyration radius of the slider,
    m.
    """
    velocity = mean_velocity(motion.time, motion.slider, SPAN)  # of the centre, m/s, and of the heading, rad/s
    speed = np.hypot(*velocity[:, :2].T)
    used = used & (speed > TRANSLATING * np.hypot(speed, radius * velocity[:, 2]))
    if np.sum(used) < FEWEST:
        return []
    push, slider = motion.push[used], motion.slider[used, 2]
    force, moved = (np.arctan2(of[used, 1], of[used, 0]) for of in (-motion.force, velocity))
    angles = {WORLD: force - moved, MIRROR: -force - moved, SLIDER: force + slider - moved}
    if motion.tool is not None and np.isfinite(motion.tool).all() and motion.tool.any():  # a heading is recorded
        angles[TIP] = force + motion.tool[used] - moved
    world, *others = (_reading(axes, each, push) for axes, each in angles.items())
    if len(np.unique(push)) < FEWEST_PUSHES:  # they show a wrong sign or a large turn only
        return [_unrelated(world)] if world.length < RELATED else _turned_axes(world, [], ALLOWED_FEW)
    bent = np.clip(radius * velocity[used, 2] / speed[used], -1.0, 1.0)
    better = [each for each in others if _clearly_better(each, world, push) or _turns(each, world, bent, push)]
    best = max(better, key=lambda each: each.length, default=world)
    if best.length < RELATED:
        return [_unrelated(best)]
    return _turned_axes(best, others) if best is world else [_other_axes(best, world)]


def _reading(axes: str, angles: Array, push: IntArray) -> Reading:
    resultant = np.mean(np.exp(1j * angles))
    turn, length = float(np.angle(resultant)), float(np.abs(resultant))
    score = sums_by_push(np.sin(angles - turn)[:, None], push)[:, 0]
    return Reading(axes, wrap_angle(angles), turn, float(np.sqrt(np.sum(score**2))) / (len(angles) * length), length)


def _clearly_better(reading: Reading, world: Reading, push: IntArray) -> bool:
    """Whether the angles agree more than those of axes fixed in the world, in most pushes, or leave far less spread."""
    gain = np.cos(reading.angles - reading.turn) - np.cos(world.angles - world.turn)
    gains = sums_by_push(gain[:, None], push)[:, 0]
    certainty = float(np.mean(gains) / (np.std(gains, ddof=1) / np.sqrt(len(gains))))
    far = 1.0 - reading.length < LEFT * (1.0 - world.length)
    return certainty > (DOUBT_FAR if far else DOUBT)


def _turns(reading: Reading, world: Reading, bent: Array, push: IntArray) -> bool:
    """Whether the angles to the world's axes change against the heading of what the sensor turns with, one for one.

    bent (n,): the turn of the slider over its motion, which bends the angles.
    """
    if reading.axes not in (SLIDER, TIP) or world.length < RELATED:
        return False
    heading = wrap_angle(reading.angles - world.angles)
    inputs = np.column_stack([heading, np.ones(len(push)), bent])
    slope, sd = _slope(inputs, wrap_angle(world.angles - world.turn), push)
    return -1.5 < slope < -0.5 - DOUBT * sd


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


def _turned_axes(world: Reading, others: list[Reading], allowed: float = ALLOWED) -> list[Finding]:
    if abs(world.turn) < max(allowed, DOUBT * world.sd):
        return []
    values = {"turn": Value(world.turn, "rad", world.sd)}
    sense, back = ("counter-clockwise", "clockwise") if world.turn > 0.0 else ("clockwise", "counter-clockwise")
    degrees, sd = f"{np.degrees(abs(world.turn)):.0f} degrees", f"{np.degrees(world.sd):.1g}"
    found = f"The force on the slider points {degrees} (sd {sd}) {sense} of the slider's motion, sound 0"
    if np.pi - abs(world.turn) < np.clip(DOUBT * world.sd, allowed, ALLOWED_FEW):
        return [Finding("wrench_sign", "warning", f"{found}: its sign is probably wrong.", SIGN, values)]
    sentence = f"{found}: its axes are not the world's."
    tip = next((each for each in others if each.axes == TIP), None)
    if tip is not None and abs(tip.turn) < max(allowed, DOUBT * tip.sd):
        advice = "The axes are those of the tip: use `--wrench-frame tip`."
    else:
        advice = (
            "State the sensor's axes: `--wrench-frame FRAME`, a frame of tf, or `--wrench-frame tip`. Without either, "
            f"turn the forces {back} by {degrees}."
        )
    return [Finding("wrench_frame", "warning", sentence, advice, values)]


def _other_axes(best: Reading, world: Reading) -> Finding:
    of = {MIRROR: "mirrored", SLIDER: "those of the slider", TIP: "those of the tip"}[best.axes]
    sentence = (
        f"The axes of the force are {of}: its angle to the slider's motion agrees over the pushes to {best.length:.2f} "
        f"then, to {world.length:.2f} along the world's axes (1 if it is always the same)."
    )
    advice = {
        MIRROR: "Give the force along right-handed axes seen from above: change the sign of one of them.",
        SLIDER: "Give the force along the world's axes, or state the sensor's: `--wrench-frame FRAME`, a frame of tf.",
        TIP: "Use `--wrench-frame tip`.",
    }[best.axes]
    if best.axes == TIP and abs(best.turn) > ALLOWED:
        turned = f"turned by {np.degrees(best.turn):.0f} degrees against the tip"
        advice = f"Use `--wrench-frame FRAME`, the sensor's frame in tf: it is {turned}."
    values = {"agreement": Value(best.length, "1"), "agreement_world": Value(world.length, "1")}
    return Finding("wrench_frame", "warning", sentence, advice, values)


def _unrelated(reading: Reading) -> Finding:
    sentence = (
        "The force is not along the slider's motion: the angle between them agrees over the contacts to "
        f"{reading.length:.2f}, sound above {RELATED} (1 if it is always the same). It is probably of another time or "
        "body."
    )
    return Finding("wrench_unrelated", "warning", sentence, TOPIC, {"agreement": Value(reading.length, "1")})
