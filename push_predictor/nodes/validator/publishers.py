# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator publishes about each window: residual, markers and, once a run, the alarm."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from msg_adapters.residuals import alarm_to_message
from push_predictor.evaluation.alarm.evidence import AlarmState, alarm_json, alarm_sentence
from push_predictor.models.prediction import Prediction
from push_predictor.nodes.qos import LATCHED
from push_predictor.nodes.validator.window_markers import window_markers
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor_interfaces.msg import PushAlarm, PushResidual


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
