"""A planner's end of the services: what it asks predict_server, as arrays."""

from __future__ import annotations

import sys
import threading
from time import monotonic
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import Point, Pose, PoseWithCovariance, Quaternion
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from msg_adapters.predictions import PushQuery, RefusedError, prediction_from_response, query_to_batch_request
from push_predictor.geometry.frames import quaternion_of_yaw
from push_predictor.models.push_model import Prediction
from push_predictor.planning.repertoire import StraightPushes
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushStep
from push_predictor_interfaces.srv import PredictPushBatch, RolloutPushes

PATIENCE = 60.0  # s for an answer, server restarts included
TIMEOUT = 5.0  # s after which an unanswered request is sent again: the longest answer takes less
DEEP = QoSProfile(depth=1000)  # a client is handed the answers to others too: ten of them would crowd out its own


class PlannerClient:
    """Asks predict_push_batch and rollout_pushes of the default model; window: s, of the model. A context manager.

    A request that is not answered within `timeout` (s) is sent again, as long as `patience` (s) lasts: a server may be
    started again meanwhile. What went unanswered is told on stderr.
    """

    def __init__(self, window: float, *, timeout: float = TIMEOUT, patience: float = PATIENCE) -> None:
        self._window, self._timeout, self._patience = window, timeout, patience
        self._context = Context()

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

    def _call(self, client: Any, request: Any) -> Any:
        """The answer. Raises SystemExit that says what was waited for, and how long."""
        begun, unanswered = monotonic(), 0
        while (left := begun + self._patience - monotonic()) > 0.0:
            if not client.wait_for_service(left):
                break
            if (response := _answer(client, request, min(self._timeout, left))) is not None:
                if unanswered:
                    _say(
                        client,
                        f"answers again after {monotonic() - begun:.1f} s; {unanswered} requests went unanswered",
                    )
                return response
            unanswered += 1
            _say(client, f"no answer within {self._timeout:g} s, asking again")
        told = f"did not answer {unanswered} requests" if unanswered else "is not offered"
        raise SystemExit(f"{client.srv_name} {told} within {self._patience:g} s: does predict_server run?")

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return


def _answer(client: Any, request: Any, timeout: float) -> Any:
    """None if there is none in time: then it is not waited for any more."""
    answered, future = threading.Event(), client.call_async(request)
    future.add_done_callback(lambda _: answered.set())
    if answered.wait(timeout):
        return future.result()
    client.remove_pending_request(future)
    return None


def _say(client: Any, text: str) -> None:
    print(f"{client.srv_name}: {text}", file=sys.stderr, flush=True)


def _pose(slider: Array) -> Pose:
    x, y, heading = slider.tolist()
    z, w = quaternion_of_yaw(np.array(heading))
    return Pose(position=Point(x=x, y=y, z=0.0), orientation=Quaternion(z=float(z), w=float(w)))
