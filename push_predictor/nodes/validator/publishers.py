# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator publishes about each window: residual, markers and, once a run, the alarm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from msg_adapters.markers import MAGNIFICATION, Sheet, label_marker, magnified_markers, prediction_markers, push_markers
from msg_adapters.residuals import alarm_to_message
from push_predictor.evaluation.alarm.evidence import AlarmState, alarm_json, alarm_sentence
from push_predictor.geometry.frames import to_world
from push_predictor.geometry.touch import covariance_in_world, displaced
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors.tails import Tails, half_widths, joint_radius
from push_predictor.nodes.qos import LATCHED
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushAlarm, PushResidual

LEVEL = 0.95


class ResultPublishers:
    """Publishers of push_residual, push_alarm and push_markers. world: returns the frame in which the poses are."""

    def __init__(self, node: Node, world: Callable[[], str]) -> None:
        self._log, self._world = node.get_logger(), world
        self._residuals = node.create_publisher(PushResidual, "push_residual", 1000)
        self._alarms = node.create_publisher(PushAlarm, "push_alarm", LATCHED)
        self._markers = node.create_publisher(MarkerArray, "push_markers", 100)  # for a burst after a stall

    def publish(self, rig: Rig, model: int, window: PushWindow, prediction: Prediction, residual: PushResidual) -> None:
        """Publish the residual of a window; markers only of the main model, 0, and while somebody subscribes."""
        self._residuals.publish(residual)
        if model == 0 and self._markers.get_subscription_count():
            self._markers.publish(window_markers(rig, window, prediction, self._world()))

    def alarm(self, model: str, state: AlarmState, end: int) -> None:
        """Log and publish an alarm about a model that has fired; end: of the push at which it fired, ns."""
        self._log.warning(alarm_sentence(alarm_json(state)))
        self._alarms.publish(alarm_to_message(state, model, end, self._world()))


def window_markers(rig: Rig, window: PushWindow, prediction: Prediction, frame_id: str) -> MarkerArray:
    """Pusher, push, outlines, 95 % ellipse, observed pose and label in frame_id; prediction: of n = 1."""
    heading, sheet, start, end = (
        window.push_heading,
        Sheet(frame_id, window.end),
        window.slider_start,
        window.slider_end,
    )
    predicted = displaced(start[None], np.array([heading]), prediction.mean)[0]
    wider = _wider(prediction.tails)
    covariance = np.outer(wider, wider) * covariance_in_world(prediction.covariance, np.array([heading]))[0]
    distance, limit = error_in_sd(window, prediction), joint_radius(prediction.tails, LEVEL)
    reach = rig.outline.reach
    return MarkerArray(
        markers=[
            *push_markers(sheet, tip_of(rig, window), rig.pusher_radius, heading),
            *prediction_markers(sheet, rig.outline.vertices, start, predicted, covariance[:2, :2], end),
            *magnified_markers(sheet, predicted, covariance, end, reach, heading),
            label_marker(sheet, _label(window, distance, limit), start[:2], reach, distance > limit),
        ]
    )


def _wider(tails: Tails | None) -> Array:
    """Factors (3,) on the sd of a Gaussian, which the markers draw, whose 95 % regions are those of the tails."""
    plane = joint_radius(tails, LEVEL, 2) / joint_radius(None, LEVEL, 2)
    turn = (half_widths(tails, LEVEL) / half_widths(None, LEVEL))[2]
    return np.array([plane, plane, turn])


def tip_of(rig: Rig, window: PushWindow) -> Array:
    """The pusher's centre (2,), m, at the window's start: of a disc that touches the outline at the contact."""
    contact = np.array([window.contact])
    centre = rig.outline.point(contact) - rig.pusher_radius * rig.outline.inward_normal(contact)
    return np.asarray(to_world(centre, window.slider_start)[0])


def error_in_sd(window: PushWindow, prediction: Prediction) -> float:
    """The Mahalanobis distance of the outcome (dx, dy, dtheta) from the prediction (n = 1)."""
    away = window.displacement - prediction.mean[0]
    return float(np.sqrt(away @ np.linalg.solve(prediction.covariance[0], away)))


def _label(window: PushWindow, distance: float, limit: float) -> str:
    return (
        f"{window.push_id}, window {window.index}\n"
        f"{1e3 * window.velocity:.0f} mm/s, error {distance:.1f} sd (95 %: {limit:.1f})\n"
        f"ellipse and dial {MAGNIFICATION:.0f} times enlarged"
    )
