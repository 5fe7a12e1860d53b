# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The sign and the axes of the force, against the motion of the tip.

The slider resists: its force on the tip points against the tip's velocity, up to the angle of the push and the friction
cone. A force along the slider's axes resists too while the slider turns little, but its direction in the slider's frame
then changes with the heading, which friction does not know.
"""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.motion import Motion, body_velocity, motion_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.types import Array, BoolArray, IntArray

LEAST_FORCE = 0.3  # N
FEWEST = 20  # samples
SOUND = 0.5  # mean cosine between the force and the direction against the motion, or against the contact's normal
CLEAR = 0.3  # by which another reading of the force must agree better
FEWEST_PUSHES = 8  # for a standard deviation of the slope over headings
DOUBT = 4.0  # standard deviations
CONE = 0.5  # tangent of an angle beyond which contacts slide
ROUNDS, OUTLYING = 10, 0.05  # of the robust regression; rad
SIGN = "Give the force of the slider on the pusher: change the sign."
AXES = "Give the force along the world's axes, or state the sensor's: --wrench-frame tip or FRAME."


def wrench_findings(recording: Recording, rig: Rig) -> list[Finding]:
    """Findings about the wrench; empty without one."""
    motion = motion_of(recording, rig)
    if motion is None:
        return []
    size = np.hypot(*motion.force.T)
    used = motion.contact & (size > LEAST_FORCE)
    if np.sum(used) < FEWEST:
        return []
    force, heading = motion.force[used] / size[used, None], motion.slider[used, 2]
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
    if best < now + CLEAR:
        return []
    sentence = f"The force does not resist the motion (mean cosine {now:.2f}, sound above {SOUND}). {reason}"
    return [Finding(name, "warning", sentence, advice, {"cosine": Value(now, "1"), "cosine_after": Value(best, "1")})]


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
    scores = np.array([inputs[push == one].T @ (weight * error)[push == one] for one in np.unique(push)])
    return float(coefficients[0]), float(np.sqrt((bread @ scores.T @ scores @ bread)[0, 0]))


def _resistance(force: Array, ahead: tuple[Array, Array]) -> float:
    """The mean cosine between the force and the opposite of the motion, or of the contact's normal: the larger one."""
    return max(-float(np.mean(np.sum(force * direction, axis=1))) for direction in ahead)
