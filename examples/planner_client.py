# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A client of predict_server for planners, in arrays."""

from __future__ import annotations

import sys
import threading
from collections.abc import Mapping
from time import monotonic
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import Point, Pose, PoseStamped, PoseWithCovariance, Quaternion
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from msg_adapters.predictions import PushQuery, RefusedError, prediction_from_response, query_to_batch_request
from push_predictor.geometry.frames import quaternion_of_yaw
from push_predictor.models.prediction import Prediction
from push_predictor.planning.repertoire import StraightPushes
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushStep
from push_predictor_interfaces.srv import PredictPushBatch, RolloutPushes

PATIENCE = 60.0  # s, for a response, restarts of the server included
TIMEOUT = 5.0  # s, after which a request is sent again; the longest response takes less
DEEP = QoSProfile(depth=1000)  # a client also receives the responses to other clients: ten would displace its own


class PlannerClient:
    """A client of predict_push_batch and rollout_pushes for the default model. A context manager.

    window: duration (s) of the model's windows. A request without a response within `timeout` (s) is sent again until
    `patience` (s) has passed: the server may restart meanwhile. Each timeout is reported on stderr.
    """

    def __init__(self, window: float, *, timeout: float = TIMEOUT, patience: float = PATIENCE) -> None:
        self._window, self._timeout, self._patience = window, timeout, patience
        self._context, self._publishers = Context(), dict[str, Any]()

    def __enter__(self) -> PlannerClient:
        rclpy.init(context=self._context)
        self._node = Node("planner", context=self._context)
        self._batch = self._node.create_client(PredictPushBatch, "predict_push_batch", qos_profile=DEEP)
        self._rollout = self._node.create_client(RolloutPushes, "rollout_pushes", qos_profile=DEEP)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        self._context.try_shutdown()

    def predict(self, inputs: Array) -> Prediction:
        """Mean, covariance and in_domain of one window for inputs (n, 3). Raises RefusedError, SystemExit."""
        request = query_to_batch_request(PushQuery("", inputs, self._window, {}))
        return prediction_from_response(self._call(self._batch, request))

    def outcomes(self, slider: Array, push: StraightPushes, samples: int, seed: int) -> Array:
        """Sampled poses (samples, 3) of a slider at (3,) in the world after a push. Raises RefusedError, SystemExit."""
        velocity, contact, angle = push.inputs[0].tolist()
        duration = self._window * int(push.windows[0])
        step = PushStep(velocity=velocity, contact=contact, angle=angle, duration=duration)
        request = RolloutPushes.Request(header=Header(frame_id="world"), steps=[step], particles=samples, seed=seed)
        request.slider = PoseWithCovariance(pose=_pose(slider))
        response = self._call(self._rollout, request)
        if not response.success:
            raise RefusedError(response.message)
        return np.reshape(response.samples, (-1, 3))

    def publish_poses(self, poses: Mapping[str, Array]) -> None:
        """Publish poses (3: x, y m, heading rad) in the world, by topic, with one stamp."""
        header = Header(stamp=self._node.get_clock().now().to_msg(), frame_id="world")
        for topic, pose in poses.items():
            if topic not in self._publishers:
                self._publishers[topic] = self._node.create_publisher(PoseStamped, topic, DEEP)
            self._publishers[topic].publish(PoseStamped(header=header, pose=_pose(pose)))

    def _call(self, client: Any, request: Any) -> Any:
        """The response. Raises SystemExit that names the service and the time waited."""
        begun, unanswered = monotonic(), 0
        while (left := begun + self._patience - monotonic()) > 0.0:
            if not client.wait_for_service(left):
                break
            if (response := _answer(client, request, min(self._timeout, left))) is not None:
                if unanswered:
                    _log(
                        client,
                        f"responds again after {monotonic() - begun:.1f} s; {unanswered} requests had no response",
                    )
                return response
            unanswered += 1
            _log(client, f"no response within {self._timeout:g} s, sending the request again")
        problem = f"no response to {unanswered} requests" if unanswered else "no such service"
        raise SystemExit(f"{client.srv_name}: {problem} within {self._patience:g} s. Is predict_server running?")

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return


def _answer(client: Any, request: Any, timeout: float) -> Any:
    """The response; None after `timeout` seconds, and the request is dropped."""
    answered, future = threading.Event(), client.call_async(request)
    future.add_done_callback(lambda _: answered.set())
    if answered.wait(timeout):
        return future.result()
    client.remove_pending_request(future)
    return None


def _log(client: Any, text: str) -> None:
    print(f"{client.srv_name}: {text}", file=sys.stderr, flush=True)


def _pose(slider: Array) -> Pose:
    x, y, heading = slider.tolist()
    z, w = quaternion_of_yaw(np.array(heading))
    return Pose(position=Point(x=x, y=y, z=0.0), orientation=Quaternion(z=float(z), w=float(w)))
