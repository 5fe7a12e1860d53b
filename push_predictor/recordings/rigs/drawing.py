# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The outline in a drawing: its one closed polygon, circle or ellipse, in metres."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.outline import SAME_LENGTH
from push_predictor.geometry.shapes import ellipse, transformed
from push_predictor.recordings.rigs.new_rig import LARGEST, SMALLEST
from push_predictor.recordings.rigs.polygon_file import Polygon, at_centroid, polygon_of
from push_predictor.types import Array

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254}


@dataclass(frozen=True, eq=False)
class Oval:
    """A circle or an ellipse: centre (2,), and axes (2, 2) that map the unit circle onto it without the centre."""

    centre: Array
    axes: Array


@dataclass(eq=False)
class Drawing:
    """What a drawing contains, y upwards, in its own unit.

    polygons: vertices (n, 2) of closed polygons; others: kinds of elements that are no closed outline. metres: length
    of the unit, None if the drawing does not state one.
    """

    polygons: list[Array] = field(default_factory=list)
    ovals: list[Oval] = field(default_factory=list)
    others: list[str] = field(default_factory=list)
    metres: float | None = None


def outline_of_drawing(path: Path, drawing: Drawing, unit: str | None, keep_origin: bool) -> Polygon:
    """The one closed outline of a drawing; the origin moves to the centroid unless keep_origin.

    unit: a key of UNITS in place of the drawing's own. Raises RigError that names the file and what it contains.
    """
    metres = drawing.metres if unit is None else UNITS[unit]
    if metres is None:
        raise RigError(f"{path}: states no unit of length, give it with --unit {{{','.join(UNITS)}}}")
    if len(drawing.polygons) + len(drawing.ovals) != 1 or drawing.others:
        raise RigError(
            f"{path}: contains {_contents(drawing)}, give a drawing with one closed outline and nothing else"
        )
    if drawing.polygons:
        vertices = metres * drawing.polygons[0]
        repeated = np.linalg.norm(vertices[-1] - vertices[0]) < SAME_LENGTH  # the end of a line that returns
        return polygon_of(path, vertices[:-1] if repeated else vertices, keep_origin)
    return _smooth(path, drawing.ovals[0], metres, keep_origin)


def _contents(drawing: Drawing) -> str:
    counts = Counter(drawing.others)
    found = [("closed polygon", len(drawing.polygons)), ("circle or ellipse", len(drawing.ovals)), *counts.items()]
    named = [f"{count} x {name}" for name, count in found if count]
    return ", ".join(named) or "no outline"


def _smooth(path: Path, oval: Oval, metres: float, keep_origin: bool) -> Polygon:
    directions, lengths, _ = np.linalg.svd(metres * oval.axes)
    if abs(directions[0, 0]) < abs(directions[1, 0]):  # a is the semi-axis that is nearer to x
        directions, lengths = directions[:, ::-1], lengths[::-1]
    if not (2.0 * lengths.min() >= SMALLEST and 2.0 * lengths.max() <= LARGEST):
        raise RigError(
            f"{path}: the ellipse is {2.0 * lengths[0]:g} x {2.0 * lengths[1]:g} m large, give {SMALLEST:g} to "
            f"{LARGEST:g} m: is the unit right?"
        )
    along = directions[:, 0] * (1.0 if directions[0, 0] > 0.0 else -1.0)
    yaw = 0.0 if abs(lengths[0] - lengths[1]) < SAME_LENGTH else float(np.arctan2(along[1], along[0]))
    x, y = (metres * oval.centre).tolist()
    turned = transformed(ellipse(*lengths.tolist()), yaw, (x, y))
    return at_centroid(turned, keep_origin, ())
