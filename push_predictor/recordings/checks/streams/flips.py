# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Flips of the slider's heading by fixed angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.repairs.flips import HeadingFlips, flip_steps
from push_predictor.types import Array, IntArray

FEWEST = 3
LARGE = np.radians(42.0)  # below the smallest fixed angle
FIXED_SHARE = 0.7  # of the large steps; of random ones, as of headings in degrees, a quarter are near a fixed angle
COMMON = 0.1  # share of the flips by an angle that is listed
OFTEN = 0.2  # share of the samples: the slider may begin anew with a flipped heading
SAME = 1e-3  # m between an outline and the same after a turn that is its symmetry
PLACE = "lace the markers so that no turn of the body maps them onto each other."
ADVICE = f"The windows undo them. P{PLACE}"
UNKNOWN = f"The true heading is not known. P{PLACE}"


def without_flips(recording: Recording, outline: Outline) -> tuple[Finding | None, Recording]:
    """A finding if the heading flips by fixed angles, and the recording with the headings that the windows use.

    Refused if it flips so often that its true value is not known, and the angles are no symmetry of the outline.
    """
    slider = recording.slider
    pose = np.column_stack([slider.x, slider.y, slider.heading])
    if not len(pose) or _share_of_fixed(slider.stamp, pose) < FIXED_SHARE:
        return None, recording
    turned = HeadingFlips().take(slider.stamp, pose)
    changes = np.diff(turned, prepend=0.0)
    flips = np.round(np.degrees(np.abs(wrap_angle(changes[np.abs(changes) > 1e-6]))))
    if len(flips) < FEWEST:
        return None, recording
    angles, counts = np.unique(flips, return_counts=True)
    listed = " and ".join(f"{angle:.0f}" for angle in angles[counts >= COMMON * len(flips)])
    share = float(np.mean(turned != 0.0))
    sentence = (
        f"The slider's heading flips {len(flips)} times by {listed} degrees while the slider stays in its place "
        f"({100.0 * share:.1f} % of the samples): the markers look alike after such a turn."
    )
    values = {"flips": Value(float(len(flips)), "1"), "share": Value(share, "1")}
    unknown = share > OFTEN and not all(_symmetric(outline, np.radians(angle)) for angle in angles)
    advice = UNKNOWN if unknown else ADVICE
    found = Finding("heading_flips", "refused" if unknown else "warning", sentence, advice, values)
    return found, replace(recording, slider=replace(slider, heading=wrap_angle(slider.heading - turned)))


def _symmetric(outline: Outline, turn: float) -> bool:
    """Whether a turn (rad) maps the outline onto itself."""
    turned = rotate(outline.vertices, np.full(len(outline.vertices), turn))
    return bool(np.max(np.abs(outline.project(turned).distance)) < SAME)


def _share_of_fixed(stamp: IntArray, pose: Array) -> float:
    """Share of the steps by a large angle, of a slider that stays, that are fixed angles; 0 without any."""
    turn, elsewhere = flip_steps(stamp, pose)
    large = ~elsewhere & (np.abs(wrap_angle(np.diff(pose[:, 2]))) > LARGE)
    return float(np.mean(turn[large] != 0.0)) if large.any() else 0.0
