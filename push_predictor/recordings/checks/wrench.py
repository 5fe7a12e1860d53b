"""The sign and the axes of the force, against the motion of the tip.

The slider resists: its force on the tip points against the tip's velocity, up to the angle of the push and the friction
cone.
"""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.types import Array

LEAST_FORCE = 0.3  # N
FEWEST = 20  # samples
SOUND = 0.5  # mean cosine between the force and the direction against the velocity
CLEAR = 0.3  # by which another reading of the force must agree better
SIGN = "Give the force of the slider on the pusher: change the sign."
AXES = "Give the force along the world's axes."


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
    ahead = motion.tip_velocity[used] / motion.tip_speed[used, None]
    now = _resistance(force, ahead)
    readings = {
        "wrench_sign": (-now, "Its sign is probably wrong.", SIGN),
        "wrench_frame": (
            max(abs(_resistance(rotate(force, heading), ahead)), _turned(force, ahead)),
            "Its axes are probably not the world's.",
            AXES,
        ),
    }
    name = "wrench_sign" if -now > SOUND else max(readings, key=lambda each: readings[each][0])
    best, reason, advice = readings[name]
    if now > SOUND or best < now + CLEAR:
        return []
    sentence = f"The force does not resist the motion (mean cosine {now:.2f}, sound above {SOUND}). {reason}"
    return [Finding(name, "warning", sentence, advice, {"cosine": Value(now, "1"), "cosine_after": Value(best, "1")})]


def _resistance(force: Array, ahead: Array) -> float:
    return -float(np.mean(np.sum(force * ahead, axis=1)))


def _turned(force: Array, ahead: Array) -> float:
    """The best resistance of forces turned by a quarter of a turn either way."""
    return max(_resistance(rotate(force, np.array(turn)), ahead) for turn in (np.pi / 2.0, -np.pi / 2.0))
