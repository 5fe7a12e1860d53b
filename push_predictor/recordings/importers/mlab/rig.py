# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig of the MLab point pushes: a right triangle on three support points, or flat on its face."""

from __future__ import annotations

import re

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.recordings.importers.report import Notes
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array

LEG = 0.150  # m
CENTROID = np.array([0.050, 0.050])  # m from the right angle
MASS = 1.518  # kg
FINGER_RADIUS = 1e-4  # m; a pointed finger: at the end of a push the logged tip lies on the edge
SURFACES = {"": "hardboard", "wood_": "plywood"}
THREE_POINTS = re.compile(r"(wood_)?((?:\d+(?:\.\d+)?_){5}\d+(?:\.\d+)?)")
PATCH = re.compile(r"(wood_)?patch")
FINGER = f"the finger is pointed: pusher radius {FINGER_RADIUS} m, contact where the tip's path meets the outline"
ROUND_TRIP = "the object is the aluminium triangle of 1.518 kg with legs of 150 mm, its centre at (50, 50) mm"


def triangle() -> Outline:
    """The triangle about its centroid.

    Edge 0 goes from the right angle along +x, edge 1 is the hypotenuse.
    """
    return Outline(np.array([[0.0, 0.0], [LEG, 0.0], [0.0, LEG]]) - CENTROID)


def folder_rig(folder: str, notes: Notes) -> Rig:
    """The rig from a log's folder name: [wood_]x1_x2_x3_y1_y2_y3 (mm) or [wood_]patch."""
    notes.assume(ROUND_TRIP)
    notes.assume(FINGER)
    if match := THREE_POINTS.fullmatch(folder):
        points = np.array([float(word) for word in match[2].split("_")]).reshape(2, 3).T / 1000.0 - CENTROID
        notes.assume(f"{folder}: the support points follow from the folder's name, their loads from the centre of mass")
        return _rig(SURFACES[match[1] or ""], np.column_stack([points, load_shares(points)]))
    if match := PATCH.fullmatch(folder):
        return _rig(SURFACES[match[1] or ""], None)
    notes.assume(
        f"{folder or 'log'}: the folder's name contains no configuration; surface and support points are unknown"
    )
    return _rig("unknown", None)


def load_shares(points: Array) -> Array:
    """Load shares (3,) of three points (3, 2) about the centre of mass."""
    return np.asarray(np.linalg.solve(np.vstack([points.T, np.ones(3)]), [0.0, 0.0, 1.0]))


def _rig(surface: str, support: Array | None) -> Rig:
    return Rig("triangle", triangle(), FINGER_RADIUS, surface, MASS, support)
