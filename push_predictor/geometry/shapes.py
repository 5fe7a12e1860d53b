"""Outlines of the MIT push data set by name (dimensions: docs/reference/push.md)."""

from __future__ import annotations

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.outline import Outline

SMOOTH_VERTICES = 128
ELLIPSES = {"ellip1": (0.0525, 0.0525), "ellip2": (0.065445, 0.0525), "ellip3": (0.0785, 0.0525)}  # semi-axes, m
SQUARE_SIDE = 0.09
HEXAGON_CIRCUMRADIUS = 0.0605
SHAPES = ("rect1", *ELLIPSES, "hex")


def shape_outline(name: str) -> Outline:
    """The outline of a shape of the MIT set. Raises RigError for a name that is not in SHAPES."""
    if name == "rect1":
        return square(SQUARE_SIDE)
    if name == "hex":
        angles = np.arange(6) * np.pi / 3.0
        return Outline(HEXAGON_CIRCUMRADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    if name in ELLIPSES:
        return ellipse(*ELLIPSES[name])
    raise RigError(f"shape: {name!r} is not accepted, give one of {', '.join(SHAPES)}")


def square(side: float) -> Outline:
    """A square whose first edge faces -x, so that its inward normal is the body's +x."""
    half = side / 2.0
    return Outline(np.array([[-half, half], [-half, -half], [half, -half], [half, half]]))


def ellipse(a: float, b: float) -> Outline:
    """An ellipse with semi-axes a along x and b along y, m; its first vertex lies on +x."""
    angles = np.arange(SMOOTH_VERTICES) * 2.0 * np.pi / SMOOTH_VERTICES
    return Outline(np.stack([a * np.cos(angles), b * np.sin(angles)], axis=1), (a, b))
