# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Frames: whether the tracked body lies on the surface, and which way it is up."""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.frames.orientation import orientation_finding
from push_predictor.recordings.checks.frames.up import up_findings
from push_predictor.recordings.checks.geometry.stage import tip_follows
from push_predictor.recordings.checks.motion import Motion, body_velocity
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array, BoolArray

HELD = 0.01  # m: spread of the tip in the frame of a body fixed to it; clocks and calibration spread it
COVERED = 95.0  # percentile of the spread
TRAVEL = 5.0  # the tip travels so many times farther in the world
AWAY = 0.3  # cosine between the tip's velocity and the direction away from the body
LEAST_SHARE = 0.1  # of the body's motion that no push explains, where the tip is near the outline


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
