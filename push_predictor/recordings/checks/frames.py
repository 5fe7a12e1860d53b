# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Frames: whether the tracked body lies on the surface, and which way is up, from positions alone.

A pushed slider stays on a plane, and the tip keeps its height while it pushes: the normal of that plane is vertical.
Between pushes the tip is lifted, never lowered into the table: that is up. Seen from above, slider and tip move the
same way in a push; seen from opposite sides, one motion is the mirror image of the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.finding import Evidence, Finding, Value
from push_predictor.recordings.checks.geometry import tip_follows
from push_predictor.recordings.checks.motion import Motion, body_velocity, noise_of
from push_predictor.recordings.checks.units import OVERTURNED, orientation_finding, tilt_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array, BoolArray

HELD = 0.01  # m: spread of the tip in the frame of a body fixed to it; clocks and calibration spread it
COVERED = 95.0  # percentile of the spread
TRAVEL = 5.0  # the tip travels so many times farther in the world
AWAY = 0.3  # cosine between the tip's velocity and the direction away from the body
LEAST_SHARE = 0.1  # of the body's motion that no push explains, where the tip is near the outline
STEPS = (0.1, 0.2, 0.5)  # s between the positions whose difference is a step of the motion: the first that noise allows
LEAST_STEP = 0.0002  # m
NOISE = 5.0  # standard deviations of a step at rest: what moves farther moves
QUIET = 0.001  # m; of a step at rest, beyond which pushes are hidden in it
MOST_STEPS = 4000  # evenly drawn
FEWEST_STEPS = 20
ALIKENESS = 8  # power of the agreement that outweighs the number of steps: twice as many for 9 % less
FLAT = 3.0  # the steps spread so many times farther in the plane, in its narrower direction, than out of it
ROUNDS = 12  # of the robust fit of the plane
NARROWEST = 0.02  # of the steps, in that direction: along one line they show no plane
ACCURACY = 0.001  # of a step: a smaller distance from the plane is rounding
UPRIGHT = np.radians(30.0)  # an axis this near to the vertical is meant to be up
LENGTH_ALLOWANCE = 0.0005  # m that a tilted view may shorten the slider
LIFT = 0.005  # m above the height of pushes
MOSTLY = 4.0  # times as many samples lie on the upper side
ALIKE = (0.4, 1.5)  # lengths of the slider's steps in a push, in terms of the tip's
MIRRORED = 1.3  # ratio of the agreements of the two motions, mirrored and as they are
AXES = ("x", "y", "z")


def frame_stage(evidence: Evidence) -> Evidence:
    """Whether the tracked body lies on the surface, and which way it is up."""
    recording, rig, motion = evidence.recording, evidence.rig, evidence.motion
    raised = up_findings(recording, rig)
    if any(finding.severity == "refused" for finding in raised):
        return evidence.found(raised)
    evidence = evidence.found(raised)
    if held := fixed_to_tip(motion, rig):
        return evidence.found([held])
    oriented = orientation_finding(recording.slider, rig)
    # A tip has a constant heading too: the exchange of topics explains more, and the geometry shows it.
    if oriented is not None and oriented.severity == "refused" and tip_follows(motion, recording, rig):
        return evidence
    return evidence.found([oriented])


def fixed_to_tip(motion: Motion | None, rig: Rig) -> Finding | None:
    """A refusal if the tracked body is fixed to the robot's hand instead of lying on the surface.

    In the frame of such a body the tip rests, also while it is lifted, or moves away from the body. A pushed slider
    stays where it is then.
    """
    if motion is None or not motion.moving.any():
        return None
    tips = to_body(motion.tip, motion.slider)
    place, spread = np.median(tips, axis=0), _spread(tips)
    if spread > HELD or _spread(motion.tip) < TRAVEL * spread:
        return None
    apart = abs(float(rig.outline.project(place[None]).distance[0]) - rig.pusher_radius) > HELD
    if not apart and np.mean(_unpushed(motion, place)[motion.moving]) < LEAST_SHARE:
        return None
    sentence = (
        f"The slider's pose moves with the tip, within {1e3 * spread:.1f} mm, also where no push can move it. It is "
        "probably that of a body on the robot's hand."
    )
    return Finding("another_body", "refused", sentence, "Check the slider's topic.", {"spread": Value(spread, "m")})


def _unpushed(motion: Motion, place: Array) -> BoolArray:
    """Which samples (n,) have a tip that is lifted, or moves away from the body; place (2,) m: of the tip in it."""
    lifted = motion.tip_height > WindowOptions().lift
    away = body_velocity(motion) @ place > AWAY * motion.tip_speed * np.hypot(*place)
    return np.asarray(lifted | away)


def _spread(points: Array) -> float:
    """Distance (m) from the median that few of the points (n, 2) exceed."""
    return float(np.percentile(np.linalg.norm(points - np.median(points, axis=0), axis=1), COVERED))


# --- which way is up --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Up:
    """The vertical in a stream's frame: a unit vector (3,); signed: whether its direction is known to be up."""

    normal: Array
    signed: bool = False

    @property
    def tilt(self) -> float:
        """Angle (rad) to the frame's z axis, up to pi; up to pi / 2 where the direction is unknown."""
        return float(np.arccos(np.clip(self.normal[2] if self.signed else abs(self.normal[2]), -1.0, 1.0)))

    @property
    def axis(self) -> str | None:
        """The axis that is meant to be up, such as "-y", None if no axis is near the vertical."""
        k = int(np.argmax(np.abs(self.normal)))
        if abs(self.normal[k]) < np.cos(UPRIGHT):
            return None
        return f"{'-' if self.normal[k] < 0.0 else ''}{AXES[k]}"


def up_findings(recording: Recording, rig: Rig) -> list[Finding]:
    """A refusal if an axis other than z is up in a stream, a warning if z is tilted; empty where z is up."""
    ups = {name: up for name, up in _ups(recording).items() if up is not None}
    wrong = {name: up for name, up in ups.items() if up.axis != "z" or _foreshortens(up, rig)}
    if not wrong:
        return []
    values = {f"{name}_tilt": Value(up.tilt, "rad") for name, up in wrong.items()}
    axes = [up.axis for up in wrong.values()]
    if None in axes or "z" in axes:
        return [_tilted(wrong, values)]
    both = len(ups) == len(wrong) == 2 and len(set(axes)) == 1
    option = f"{axes[0]}" if both else ",".join(f"{name}={axis}" for name, axis in zip(wrong, axes, strict=True))
    advice = f"Turn the poses until z points up: `--up={option}`."
    if both and recording.wrench is not None:
        advice += f" If the force is along the axes of that world, too: `--up={option},wrench={option}`."
    named = " and ".join(f"in the {name}'s frame {up.axis}" for name, up in wrong.items())
    sentence = (
        f"The axis that points up is {named}, not z: the pushes are in the plane normal to it, and the tip is lifted "
        "along it. Contacts would be mirrored, or none."
    )
    return [Finding("world_up", "refused", sentence, advice, values)]


def _tilted(wrong: dict[str, Up], values: dict[str, Value]) -> Finding:
    refused = any(up.axis is None for up in wrong.values())
    stated = " and ".join(f"{np.degrees(up.tilt):.0f} degrees in the {name}'s frame" for name, up in wrong.items())
    sentence = f"The plane of the pushes is tilted against the plane of x and y by {stated}: it shortens lengths."
    advice = "Calibrate the frame on the table, or publish its pose in a level frame on /tf and give --world-frame."
    return Finding("world_tilted", "refused" if refused else "warning", sentence, advice, values)


def _foreshortens(up: Up, rig: Rig) -> bool:
    """Whether a tilted view shortens the slider by more than a finding on its size allows."""
    return rig.outline.reach * (1.0 - abs(float(up.normal[2]))) > LENGTH_ALLOWANCE


def _ups(recording: Recording) -> dict[str, Up | None]:
    """The vertical in the frames of slider and pusher, None where the positions do not show it."""
    slider, pusher = recording.slider, recording.pusher
    if min(len(slider), len(pusher)) < FEWEST_STEPS:
        return {}
    begin, end = max(slider.stamp.min(), pusher.stamp.min()), min(slider.stamp.max(), pusher.stamp.max())
    span, least = _span(slider)
    time = np.linspace(begin, end - 1e9 * span, MOST_STEPS)
    if time[-1] <= time[0]:
        return {}
    (_, step), (tip, tip_step) = _positions(slider, time, span), _positions(pusher, time, span)
    length, tip_length = np.linalg.norm(step, axis=1), np.linalg.norm(tip_step, axis=1)
    moved = (length > least) & (tip_length > LEAST_STEP)
    one, other = _plane(step[moved]), _plane(tip_step[moved])
    if other is not None:
        height = tip @ other.normal
        lifted = _lifted(height, moved, other)
        if one is not None:  # where both do not agree, a hand or a clock moves one of them
            pushed = _lifted(height, _pushes(one, other, step, tip_step, height, moved), other)
            lifted = lifted if np.array_equal(pushed.normal, lifted.normal) else other
        other = lifted
    if one is not None and other is not None:
        pushed = moved & (length > ALIKE[0] * tip_length) & (length < ALIKE[1] * tip_length)
        one = _as_seen_with(other, one, step[pushed], tip_step[pushed], slider)
    return {"slider": one, "pusher": other}


def _span(slider: PoseStream) -> tuple[float, float]:
    """The time (s) of a step, and the length (m) from which on a step is a motion, whatever the tracker's noise."""
    place = np.column_stack([slider.x, slider.y, slider.z])
    noise = NOISE * float(np.max(noise_of(place))) * np.sqrt(2.0)
    return next((span for span in STEPS if noise * STEPS[0] < QUIET * span), STEPS[-1]), max(noise, LEAST_STEP)


def _positions(stream: PoseStream, time: Array, span: float) -> tuple[Array, Array]:
    """Places (n, 3) m at times (n,) ns, and the steps (n, 3) m from there in a span (s)."""
    order = np.unique(stream.stamp, return_index=True)[1]
    known = stream.stamp[order].astype(np.float64)
    columns = [of[order] for of in (stream.x, stream.y, stream.z)]
    now, then = (np.column_stack([np.interp(at, known, of) for of in columns]) for at in (time, time + 1e9 * span))
    return now, then - now


def _plane(steps: Array) -> Up | None:
    """The normal of the plane in which most of the steps (n, 3) m lie, None if they do not show one.

    The axis that is nearest to it points along it.
    """
    if len(steps) < FEWEST_STEPS:
        return None
    steps, weight = steps / np.linalg.norm(steps, axis=1, keepdims=True), np.ones(len(steps))  # a fast hand counts once
    for _ in range(ROUNDS):
        _, axes = np.linalg.eigh((steps * weight[:, None]).T @ steps)
        off = np.abs(steps @ axes[:, 0])
        weight = 1.0 / (off + ACCURACY)
    narrow = float(np.sqrt(np.median((steps @ axes[:, 1]) ** 2)))
    if narrow < max(FLAT * float(np.median(off)), NARROWEST):
        return None
    normal = axes[:, 0]
    return Up(normal * np.sign(normal[np.argmax(np.abs(normal))]))


def _pushes(slider: Up, tip: Up, steps: Array, tip_steps: Array, height: Array, moved: BoolArray) -> BoolArray:
    """The steps (n,) that are pushes: of those on either side of the middle height, where more go the same way.

    A hand may carry the slider back while the tip is lifted, for longer than all pushes last.
    """

    def alike(side: BoolArray) -> float:
        one, other = _seen_along(slider.normal, steps[side]), _seen_along(tip.normal, tip_steps[side])
        agreement = max(abs(np.sum(np.conj(one) * other)), abs(np.sum(one * other))) / max(len(one), 1)
        return float(len(one) * agreement**ALIKENESS)

    upper = height > 0.5 * (height[moved].min() + height[moved].max())
    return max((moved & ~upper, moved & upper), key=alike) if np.ptp(height[moved]) > LIFT else moved


def _lifted(height: Array, moved: BoolArray, up: Up) -> Up:
    """With the direction in which the tip is lifted, if it is; height (n,) m along the normal."""
    usual = float(np.median(height[moved]))
    above, below = int(np.sum(height > usual + LIFT)), int(np.sum(height < usual - LIFT))
    if max(above, below) < FEWEST_STEPS or max(above, below) < MOSTLY * min(above, below):
        return up
    return Up(up.normal if above > below else -up.normal, signed=True)


def _as_seen_with(tip: Up, slider: Up, steps: Array, tip_steps: Array, stream: PoseStream) -> Up:
    """The slider's vertical, in the direction from which its steps (n, 3) m are those of the tip, and not mirrored.

    Axes of a planar tracker that are mirrored are no matter of up and down.
    """
    one, other = _seen_along(slider.normal, steps), _seen_along(tip.normal, tip_steps)
    alike, mirrored = abs(np.sum(np.conj(one) * other)), abs(np.sum(one * other))
    if max(alike, mirrored) < MIRRORED * min(alike, mirrored):  # pushes along one line: as in one world
        return Up(tip.normal, tip.signed) if slider.axis == (tip.axis or "").removeprefix("-") else slider
    same = alike > mirrored
    level = slider.axis == "z" and tip.axis == "z"
    if level and not same and tilt_of(stream) < OVERTURNED:
        return slider
    return Up(slider.normal if same else -slider.normal, signed=tip.signed)


def _seen_along(normal: Array, steps: Array) -> Array:
    """Directions of steps (n, 3) as complex numbers (n,) in a right-handed frame whose third axis is the normal."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.asarray(np.exp(1j * np.arctan2(steps @ np.cross(normal, first), steps @ first)))
