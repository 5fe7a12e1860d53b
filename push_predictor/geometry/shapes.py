# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Outlines of common shapes, and of the MIT push data set by name (dimensions: docs/reference/push.md)."""

from __future__ import annotations

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import SAME_LENGTH, Outline
from push_predictor.types import Array

SMOOTH_VERTICES = 128
ELLIPSES = {"ellip1": (0.0525, 0.0525), "ellip2": (0.065445, 0.0525), "ellip3": (0.0785, 0.0525)}  # semi-axes, m
SQUARE_SIDE = 0.09
HEXAGON_CIRCUMRADIUS = 0.0605
NEAR = 0.08  # of the reach: vertices that one wrong measurement would bring together
SHAPES = ("rect1", *ELLIPSES, "hex")
MASSES = {"rect1": 0.837, "ellip1": 0.894, "ellip2": 1.110, "ellip3": 1.334, "hex": 0.983}  # kg; Yu et al. 2016


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
    return rectangle(side, side)


def rectangle(width: float, height: float) -> Outline:
    """A rectangle, width along x and height along y, m. Its first edge faces -x, so that its inward normal is +x."""
    x, y = width / 2.0, height / 2.0
    return Outline(np.array([[-x, y], [-x, -y], [x, -y], [x, y]]))


def ellipse(a: float, b: float) -> Outline:
    """An ellipse with semi-axes a along x and b along y, m; its first vertex lies on +x."""
    angles = np.arange(SMOOTH_VERTICES) * 2.0 * np.pi / SMOOTH_VERTICES
    return Outline(np.stack([a * np.cos(angles), b * np.sin(angles)], axis=1), (a, b))


def transformed(
    outline: Outline, yaw: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), size: float = 1.0
) -> Outline:
    """The outline scaled and turned (rad, counter-clockwise) about its centroid, then shifted (m)."""
    vertices = transformed_points(outline, outline.vertices, yaw, shift, size)
    if outline.semi_axes is None:
        return Outline(vertices)
    a, b = outline.semi_axes
    x, y, turn = outline.pose
    return Outline(vertices, (size * a, size * b), (x + shift[0], y + shift[1], turn + yaw))


def transformed_points(outline: Outline, points: Array, yaw: float, shift: tuple[float, float], size: float) -> Array:
    """Points (n, 2) of the slider that `transformed` moves with the outline."""
    centre = outline.centroid
    return np.asarray(centre + rotate(size * (points - centre), np.array(yaw)) + shift)


def stretched(outline: Outline, stretch: float) -> Outline:
    """The outline, centroid at the origin, longer along its x axis by half of `stretch` (relative), shorter along y.

    The axes of an ellipse are its semi-axes.
    """
    if stretch == 0.0:
        return outline
    factors = np.array([1.0 + stretch / 2.0, 1.0 - stretch / 2.0])
    if outline.semi_axes is None:
        return Outline(outline.vertices * factors)
    turn = np.array(outline.pose[2])
    vertices = rotate(factors * rotate(outline.vertices, -turn), turn)
    a, b = (np.array(outline.semi_axes) * factors).tolist()
    return Outline(vertices, (a, b), outline.pose)


def near_symmetry(outline: Outline) -> int:
    """The largest order of a turn about the origin after which no vertex is far from another; 0 for a circle.

    At least the order of the rotational symmetry: a regular hexagon with one wrong vertex still has order 6.
    """
    exact = outline.rotational_symmetry
    if outline.semi_axes is not None:
        return exact
    vertices, near = outline.vertices, NEAR * outline.reach
    orders = (k for k in range(len(vertices), 1, -1) if _after_turn(vertices, k) < near)
    return next(orders, exact)


def _after_turn(vertices: Array, order: int) -> float:
    """The largest distance (m) of a vertex, turned by a fraction of a full turn, from the nearest vertex."""
    turned = rotate(vertices, np.array(2.0 * np.pi / order))
    return float(np.max(np.min(np.linalg.norm(turned[:, None] - vertices, axis=2), axis=1)))


def mirror_image(outline: Outline) -> Outline:
    """The outline with its y axis reversed. The first vertex stays the first."""
    vertices = outline.vertices * [1.0, -1.0]
    x, y, yaw = outline.pose
    return Outline(np.concatenate([vertices[:1], vertices[:0:-1]]), outline.semi_axes, (x, -y, -yaw))


def has_mirror_symmetry(outline: Outline) -> bool:
    """Whether a turn and a shift map the mirror image onto the outline."""
    if outline.semi_axes is not None:
        return True
    apart, image = _distances(outline.vertices), _distances(mirror_image(outline).vertices)
    turns = (np.roll(image, (k, k), axis=(0, 1)) for k in range(len(image)))
    return any(np.allclose(apart, turned, rtol=0.0, atol=SAME_LENGTH) for turned in turns)


def _distances(vertices: Array) -> Array:
    """Distances (V, V) between vertices, m."""
    return np.asarray(np.linalg.norm(vertices[:, None] - vertices, axis=2))
