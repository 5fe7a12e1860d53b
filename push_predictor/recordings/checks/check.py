# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Check a recording or a push table before anything is learnt from it."""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.frames import frame_findings, tip_follows
from push_predictor.recordings.checks.motion import Motion, body_velocity, motion_of
from push_predictor.recordings.checks.table_signs import table_signs
from push_predictor.recordings.checks.units import orientation_finding, stream_units, table_units
from push_predictor.recordings.checks.wrench import wrench_findings
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.recordings.windows.regular_stamps import stamp_noise
from push_predictor.types import Array, BoolArray

HELD = 0.01  # m: spread of the tip in the frame of a body fixed to it; clocks and calibration spread it
COVERED = 95.0  # percentile of the spread
TRAVEL = 5.0  # the tip travels so many times farther in the world
AWAY = 0.3  # cosine between the tip's velocity and the direction away from the body
LEAST_SHARE = 0.1  # of the body's motion that no push explains, where the tip is near the outline
STAMPS = "Windows use regular stamps in their place. Better: stamp each sample when it is measured, not at receipt."


def check_recording(recording: Recording, rig: Rig) -> tuple[Finding, ...]:
    """The probable mistakes of a recording, none if it is sound. Wrong units hide the other mistakes."""
    if wrong_units := stream_units(recording, rig):
        return tuple(wrong_units)
    motion = motion_of(recording, rig)
    if held := fixed_to_tip(motion, rig):
        return (held,)
    oriented = orientation_finding(recording.slider)
    # A tip has a constant heading too: the exchange of topics explains more.
    if oriented is not None and oriented.severity == "refused" and not tip_follows(motion, recording, rig):
        return (oriented,)
    frames = frame_findings(recording, rig, motion)
    if any(finding.name == "topics_swapped" for finding in frames):
        return tuple(frames)
    if oriented is not None and oriented.severity == "refused":
        return (oriented,)
    if any(finding.severity == "refused" for finding in frames):
        return tuple(frames)
    found = frames if oriented is None else [oriented, *frames]
    outlined = all(finding.severity == "note" for finding in found)
    return (*found, *wrench_findings(motion, rig, outlined), *_stamp_findings(recording))


def check_table(table: PushTable, rig: Rig | None = None) -> tuple[Finding, ...]:
    """The probable mistakes of a push table, none if it is sound."""
    return tuple(table_units(table, rig) or table_signs(table, rig))


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


def _stamp_findings(recording: Recording) -> list[Finding]:
    """A note on streams whose stamps the window finder replaces by regular ones; empty without any."""
    streams = {"slider": recording.slider, "pusher": recording.pusher, "wrench": recording.wrench}
    noise = {name: stamp_noise(stream.stamp) for name, stream in streams.items() if stream is not None}
    noisy = {name: each for name, each in noise.items() if each is not None and each.corrected}
    if not noisy:
        return []
    listed = ", ".join(
        f"{name} {1e3 * each.jitter:.2g} ms ({100.0 * each.jitter / each.period:.0f} % of the period)"
        for name, each in noisy.items()
    )
    values = {f"{name}_jitter": Value(each.jitter, "s") for name, each in noisy.items()}
    return [Finding("stamp_jitter", "note", f"The stamps have jitter (standard deviation): {listed}.", STAMPS, values)]
