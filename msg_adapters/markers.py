"""One window as visualization_msgs/MarkerArray: what was predicted beside what was observed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.stamps import ns_to_stamp
from push_predictor.geometry.frames import to_world
from push_predictor.types import Array

CHI2_95_OF_TWO = 5.991464547107979  # -2 log(0.05): the 95 % quantile of chi-squared with two degrees of freedom
ELLIPSE_POINTS = 49
LINE_WIDTH = 0.001  # m
CENTRE_DIAMETER = 0.004  # m
GREY, BLUE, ORANGE = (0.6, 0.6, 0.6, 0.6), (0.1, 0.4, 0.9, 1.0), (0.95, 0.5, 0.1, 1.0)


@dataclass(frozen=True)
class _Sheet:
    """Where and when the markers of one window lie."""

    frame_id: str
    stamp_ns: int

    def line(self, name: str, points: Array, colour: tuple[float, ...]) -> Marker:
        marker = self._marker(name, Marker.LINE_STRIP, LINE_WIDTH, colour)
        marker.points = [Point(x=float(x), y=float(y)) for x, y in points]
        return marker

    def ball(self, name: str, centre: Array, colour: tuple[float, ...]) -> Marker:
        marker = self._marker(name, Marker.SPHERE, CENTRE_DIAMETER, colour)
        marker.pose.position.x, marker.pose.position.y = float(centre[0]), float(centre[1])
        return marker

    def _marker(self, name: str, kind: int, size: float, colour: tuple[float, ...]) -> Marker:
        marker = Marker(ns=name, id=0, type=kind, action=Marker.ADD)
        marker.header.frame_id, marker.header.stamp = self.frame_id, ns_to_stamp(self.stamp_ns)
        marker.pose.orientation.w = 1.0
        marker.scale.x = marker.scale.y = marker.scale.z = size
        marker.color = ColorRGBA(**dict(zip("rgba", colour, strict=True)))
        return marker


def prediction_markers(
    rig_outline_vertices: Array,
    slider_start: Array,
    predicted_pose: Array,
    covariance_world_xy: Array,
    observed_pose: Array,
    frame_id: str,
    stamp: int,
) -> MarkerArray:
    """The 95 % ellipse around the predicted centre, the outlines at start, predicted and observed, the observed centre.

    rig_outline_vertices: (V, 2), m, body frame. slider_start, predicted_pose, observed_pose: (3,) x, y (m), heading
    (rad) in `frame_id`. covariance_world_xy: (2, 2) of the predicted centre along that frame's axes, m^2. stamp: ns.
    Each marker has a namespace of its own and id 0, so a window replaces the one before.
    """
    sheet = _Sheet(frame_id, stamp)
    closed = np.vstack([rig_outline_vertices, rig_outline_vertices[:1]])
    return MarkerArray(
        markers=[
            sheet.line("start_outline", to_world(closed, slider_start), GREY),
            sheet.line("predicted_outline", to_world(closed, predicted_pose), BLUE),
            sheet.line("predicted_ellipse", confidence_ellipse(predicted_pose[:2], covariance_world_xy), BLUE),
            sheet.line("observed_outline", to_world(closed, observed_pose), ORANGE),
            sheet.ball("observed_centre", observed_pose, ORANGE),
        ]
    )


def delete_markers(frame_id: str, stamp: int) -> MarkerArray:
    """Takes everything this publisher drew off the screen; stamp in ns."""
    marker = Marker(action=Marker.DELETEALL)
    marker.header.frame_id, marker.header.stamp = frame_id, ns_to_stamp(stamp)
    return MarkerArray(markers=[marker])


def confidence_ellipse(centre: Array, covariance: Array) -> Array:
    """Points (ELLIPSE_POINTS, 2) of the closed curve that holds 95 % of N(centre (2,), covariance (2, 2))."""
    angle = np.linspace(0.0, 2.0 * np.pi, ELLIPSE_POINTS)
    variance, axes = np.linalg.eigh(covariance)
    radius = np.sqrt(CHI2_95_OF_TWO * np.maximum(variance, 0.0))
    return np.asarray(centre + (radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)) @ axes.T)
