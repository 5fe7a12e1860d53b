# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw visualization_msgs/Marker messages with matplotlib, seen from above.

Types, poses, scales and colours are those of the messages. Unlike in a viewer there is no perspective and no light, and
lines are at least LEAST_LINE wide.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from visualization_msgs.msg import Marker, MarkerArray

from push_predictor.geometry.frames import to_world, yaw_of_quaternion
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST_LINE = 0.7  # points
CAPITAL = 0.73  # height of a capital A in units of the font's size
POINTS_PER_INCH = 72.0


def draw_array(axes: Axes, array: MarkerArray) -> None:
    """Draw the markers of a message in its order. The limits of the axes (m) must be set and their aspect equal.

    Raises ValueError for a marker of a type or with an action that this canvas does not know.
    """
    for marker in array.markers:
        if marker.action != Marker.ADD or marker.type not in _PAINTERS:
            raise ValueError(f"marker {marker.ns}: type {marker.type}, action {marker.action} cannot be drawn")
        _PAINTERS[marker.type](axes, marker)


def place(marker: Marker) -> Array:
    """The marker's pose (3,): x, y m, heading rad, seen from above."""
    q = marker.pose.orientation
    heading = yaw_of_quaternion(*(np.array(part) for part in (q.x, q.y, q.z, q.w)))
    return np.array([marker.pose.position.x, marker.pose.position.y, float(heading)])


def points(marker: Marker, scale: tuple[float, float] = (1.0, 1.0)) -> Array:
    """The marker's points (n, 2), m, after its pose; triangles are scaled before."""
    own = np.array([[point.x, point.y] for point in marker.points]).reshape(-1, 2) * scale
    return np.asarray(to_world(own, place(marker)))


def points_per_metre(axes: Axes) -> float:
    """How many typographic points a metre of the scene takes."""
    figure = axes.get_figure()
    assert figure is not None
    low, high = axes.get_xlim()
    pixels = axes.get_window_extent().width / (high - low)
    return float(pixels * POINTS_PER_INCH / figure.dpi)


def _line(axes: Axes, marker: Marker) -> None:
    width = max(marker.scale.x * points_per_metre(axes), LEAST_LINE)
    axes.plot(*points(marker).T, color=_colour(marker), linewidth=width, solid_joinstyle="round")


def _ellipse(axes: Axes, marker: Marker) -> None:
    from matplotlib.patches import Ellipse

    x, y, heading = place(marker)
    size = marker.scale.x, marker.scale.y
    axes.add_patch(Ellipse((x, y), *size, angle=np.degrees(heading), facecolor=_colour(marker), linewidth=0.0))


def _arrow(axes: Axes, marker: Marker) -> None:
    """The form with two points: scale.x is the shaft's diameter, scale.y the head's, scale.z the head's length."""
    from matplotlib.patches import Polygon

    tail, tip = points(marker)
    along = (tip - tail) / np.linalg.norm(tip - tail)
    across, neck = np.array([-along[1], along[0]]), tip - marker.scale.z * along
    shaft, head = 0.5 * marker.scale.x * across, 0.5 * marker.scale.y * across
    corners = [tail + shaft, neck + shaft, neck + head, tip, neck - head, neck - shaft, tail - shaft]
    axes.add_patch(Polygon(corners, facecolor=_colour(marker), linewidth=0.0))


def _triangles(axes: Axes, marker: Marker) -> None:
    from matplotlib.collections import PolyCollection

    corners = points(marker, (marker.scale.x, marker.scale.y)).reshape(-1, 3, 2)
    axes.add_collection(PolyCollection(list(corners), facecolor=_colour(marker), linewidth=0.0))


def _text(axes: Axes, marker: Marker) -> None:
    size = marker.scale.z * points_per_metre(axes) / CAPITAL
    x, y, _ = place(marker)
    axes.text(x, y, marker.text, color=_colour(marker), fontsize=size, ha="center", va="center", linespacing=1.25)


def _colour(marker: Marker) -> tuple[float, float, float, float]:
    return marker.color.r, marker.color.g, marker.color.b, marker.color.a


_PAINTERS: dict[int, Callable[[Axes, Marker], None]] = {
    Marker.LINE_STRIP: _line,
    Marker.SPHERE: _ellipse,
    Marker.CYLINDER: _ellipse,
    Marker.ARROW: _arrow,
    Marker.TRIANGLE_LIST: _triangles,
    Marker.TEXT_VIEW_FACING: _text,
}
