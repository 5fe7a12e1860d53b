# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One window as visualization_msgs/Marker: predicted next to observed (docs/how_to/visualisation.md).

A window moves a slider of 90 mm by some millimetres, and the model's uncertainty is tenths of one: invisible at the
scale of the slider. So the error is drawn twice: at true scale, and magnified MAGNIFICATION times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters import ns_to_stamp
from push_predictor.geometry.frames import to_world, wrap_angle
from push_predictor.geometry.touch import covariance_in_world, displaced
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors.tails import Tails, half_widths, joint_radius
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array

LEVEL = 0.95
CHI2_95_OF_TWO = 5.991464547107979  # -2 log(0.05): the 95 % quantile of chi-squared with two degrees of freedom
NORMAL_95 = 1.959963984540054  # half-width of the 95 % interval of a normal variable, in standard deviations
MAGNIFICATION = 20.0
ELLIPSE_POINTS = 49
LINE_WIDTH, FINE_WIDTH = 0.0008, 0.0001  # m
CENTRE_DIAMETER, MAGNIFIED_DIAMETER = 0.0003, 0.004  # m; of the dots for the observed centre, true and magnified
DISC_HEIGHT = 0.001  # m
ARROW_LENGTH, ARROW_WIDTHS = 0.02, (0.002, 0.006, 0.008)  # m; widths of shaft and head, length of the head
DIAL = (1.06, 1.14, 1.02, 1.18)  # radii of the band, then of the observed stroke, in units of the outline's reach
LABEL_PLACE, LABEL_HEIGHT = 1.4, 0.005  # above the centre in units of the outline's reach; m
GREY, BLUE, ORANGE = (0.65, 0.65, 0.65, 0.8), (0.3, 0.6, 1.0, 1.0), (1.0, 0.55, 0.1, 1.0)
WHITE, RED = (0.9, 0.9, 0.9, 0.8), (1.0, 0.35, 0.3, 1.0)
ORIGIN = np.zeros(2)


@dataclass(frozen=True)
class Sheet:
    """Frame and stamp (ns) of the markers of one window, and the kinds of marker.

    Each marker has a namespace of its own and id 0, so a window replaces the one before.
    """

    frame_id: str
    stamp_ns: int

    def marker(
        self,
        name: str,
        kind: int,
        size: float | Sequence[float],
        colour: tuple[float, ...],
        *,
        at: Array = ORIGIN,
        through: Array | Sequence[Array] = (),
        text: str = "",
    ) -> Marker:
        """A marker of a kind. size: m, one for all axes, or of each. at: its place; through: points (n, 2) of it."""
        marker = Marker(ns=name, id=0, type=kind, action=Marker.ADD, text=text)
        marker.header.frame_id, marker.header.stamp = self.frame_id, ns_to_stamp(self.stamp_ns)
        marker.pose.position.x, marker.pose.position.y = float(at[0]), float(at[1])
        marker.pose.orientation.w = 1.0
        marker.scale.x, marker.scale.y, marker.scale.z = np.broadcast_to(size, 3).tolist()
        marker.color = ColorRGBA(**dict(zip("rgba", colour, strict=True)))
        marker.points = [Point(x=float(x), y=float(y)) for x, y in through]
        return marker

    def line(self, name: str, points: Array, colour: tuple[float, ...], width: float = LINE_WIDTH) -> Marker:
        """A line through points (n, 2)."""
        return self.marker(name, Marker.LINE_STRIP, width, colour, through=points)


def window_markers(rig: Rig, window: PushWindow, prediction: Prediction, frame_id: str) -> MarkerArray:
    """Pusher, push, outlines, 95 % ellipse, observed pose and label in frame_id; prediction: of n = 1.

    The label is red if the outcome lies outside the 95 % region. The arrow of the push ends at the pusher's back; its
    length has no meaning.
    """
    heading, start, end = window.push_heading, window.slider_start, window.slider_end
    sheet, reach = Sheet(frame_id, window.end), rig.outline.reach
    predicted = displaced(start[None], np.array([heading]), prediction.mean)[0]
    wider = _wider(prediction.tails)
    covariance = np.outer(wider, wider) * covariance_in_world(prediction.covariance, np.array([heading]))[0]
    tip, ahead = _tip(rig, window), np.array([np.cos(heading), np.sin(heading)])
    back = tip - rig.pusher_radius * ahead
    distance, limit = error_in_sd(window, prediction), joint_radius(prediction.tails, LEVEL)
    label = (
        f"{window.push_id}, window {window.index}\n"
        f"{1e3 * window.velocity:.0f} mm/s, error {distance:.1f} sd (95 %: {limit:.1f})\n"
        f"ellipse and dial {MAGNIFICATION:.0f} times enlarged"
    )
    above, colour = start[:2] + np.array([0.0, LABEL_PLACE * reach]), RED if distance > limit else WHITE
    diameter = 2.0 * rig.pusher_radius
    return MarkerArray(
        markers=[
            sheet.marker("pusher", Marker.CYLINDER, (diameter, diameter, DISC_HEIGHT), WHITE, at=tip),
            sheet.marker("push", Marker.ARROW, ARROW_WIDTHS, WHITE, through=(back - ARROW_LENGTH * ahead, back)),
            *prediction_markers(sheet, rig.outline.vertices, start, predicted, covariance[:2, :2], end),
            *magnified_markers(sheet, predicted, covariance, end, reach, heading),
            sheet.marker("label", Marker.TEXT_VIEW_FACING, LABEL_HEIGHT, colour, at=above, text=label),
        ]
    )


def error_in_sd(window: PushWindow, prediction: Prediction) -> float:
    """The Mahalanobis distance of the outcome (dx, dy, dtheta) from the prediction (n = 1)."""
    away = window.displacement - prediction.mean[0]
    return float(np.sqrt(away @ np.linalg.solve(prediction.covariance[0], away)))


def _wider(tails: Tails | None) -> Array:
    """Factors (3,) on the sd of a Gaussian, which the markers draw, whose 95 % regions are those of the tails."""
    plane = joint_radius(tails, LEVEL, 2) / joint_radius(None, LEVEL, 2)
    turn = (half_widths(tails, LEVEL) / half_widths(None, LEVEL))[2]
    return np.array([plane, plane, turn])


def _tip(rig: Rig, window: PushWindow) -> Array:
    """The pusher's centre (2,), m, at the window's start: of a disc that touches the outline at the contact."""
    contact = np.array([window.contact])
    centre = rig.outline.point(contact) - rig.pusher_radius * rig.outline.inward_normal(contact)
    return np.asarray(to_world(centre, window.slider_start)[0])


def prediction_markers(
    sheet: Sheet,
    rig_outline_vertices: Array,
    slider_start: Array,
    predicted_pose: Array,
    covariance_world_xy: Array,
    observed_pose: Array,
) -> list[Marker]:
    """Outlines at the start, predicted and observed; 95 % ellipse of the predicted centre; observed centre.

    rig_outline_vertices: (V, 2), m, body frame. slider_start, predicted_pose, observed_pose: (3,) x, y (m), heading
    (rad) in the sheet's frame. covariance_world_xy: (2, 2) of the predicted centre along that frame's axes, m^2.
    """
    closed = np.vstack([rig_outline_vertices, rig_outline_vertices[:1]])
    ellipse = confidence_ellipse(predicted_pose[:2], covariance_world_xy)
    return [
        sheet.line("start_outline", to_world(closed, slider_start), GREY),
        sheet.line("predicted_outline", to_world(closed, predicted_pose), BLUE),
        sheet.line("predicted_ellipse", ellipse, BLUE, FINE_WIDTH),
        sheet.line("observed_outline", to_world(closed, observed_pose), ORANGE),
        sheet.marker("observed_centre", Marker.SPHERE, CENTRE_DIAMETER, ORANGE, at=observed_pose),
    ]


def magnified_markers(
    sheet: Sheet, predicted_pose: Array, covariance_world: Array, observed_pose: Array, reach: float, ahead: float
) -> list[Marker]:
    """The outcome relative to the prediction, MAGNIFICATION times enlarged.

    Around the predicted centre its 95 % ellipse, and a dot for the observed centre. Outside the outline a dial: its
    middle, in the direction `ahead` (rad), is the predicted heading, its band the 95 % interval of the heading, a
    stroke the observed heading. predicted_pose, observed_pose (3,): x, y m, heading rad; covariance_world (3, 3) of
    x, y, heading along the axes of the sheet's frame; reach: the outline's largest distance from its centre, m.
    """
    centre = predicted_pose[:2]
    ellipse = confidence_ellipse(centre, MAGNIFICATION**2 * covariance_world[:2, :2])
    observed = centre + MAGNIFICATION * (observed_pose[:2] - centre)
    spread = min(MAGNIFICATION * NORMAL_95 * float(np.sqrt(max(covariance_world[2, 2], 0.0))), np.pi)
    turned = ahead + np.clip(MAGNIFICATION * wrap_angle(observed_pose[2] - predicted_pose[2]), -np.pi, np.pi)
    low, high, begin, end = reach * np.array(DIAL)
    stroke = _polar(centre, np.array([begin, end]), np.array([turned, turned]))
    return [
        sheet.line("magnified_ellipse", ellipse, BLUE),
        sheet.marker("magnified_observed", Marker.SPHERE, MAGNIFIED_DIAMETER, ORANGE, at=observed),
        sheet.line("magnified_heading", _band(centre, low, high, ahead, spread), BLUE),
        sheet.line("magnified_observed_heading", stroke, ORANGE),
    ]


def confidence_ellipse(centre: Array, covariance: Array) -> Array:
    """Points (ELLIPSE_POINTS, 2) of the closed curve that contains 95 % of N(centre (2,), covariance (2, 2))."""
    angle = np.linspace(0.0, 2.0 * np.pi, ELLIPSE_POINTS)
    variance, axes = np.linalg.eigh(covariance)
    radius = np.sqrt(CHI2_95_OF_TWO * np.maximum(variance, 0.0))
    return np.asarray(centre + (radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)) @ axes.T)


def _band(centre: Array, low: float, high: float, middle: float, spread: float) -> Array:
    """The closed border of the part of a ring between two radii within `spread` of an angle."""
    there = np.linspace(middle - spread, middle + spread, ELLIPSE_POINTS)
    angle = np.concatenate([there, there[::-1], there[:1]])
    radius = np.concatenate([np.full(len(there), low), np.full(len(there), high), [low]])
    return _polar(centre, radius, angle)


def _polar(centre: Array, radius: Array, angle: Array) -> Array:
    return np.asarray(centre + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
