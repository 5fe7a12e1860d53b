"""The node that serves push models: six services and the action trace_residual (docs/reference/predict_server.md)."""

from __future__ import annotations

import gc
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from threading import Event
from time import perf_counter
from typing import Any, TypeAlias

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, qos_profile_system_default
from rclpy.service import Service

from msg_adapters.diagnostics import diagnostic_array
from msg_adapters.predictions import refuse
from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_registry import SHIPPED, ModelRegistry
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.runtime import Stop, run
from push_predictor.nodes.server.answers import answer_batch, answer_list, answer_load, answer_push
from push_predictor.nodes.server.direct_service import DirectService
from push_predictor.nodes.server.heartbeat import Heartbeat
from push_predictor.nodes.server.parameters import INTROSPECTION, PARAMETERS
from push_predictor.nodes.server.pose_answers import answer_slider_pose
from push_predictor.nodes.server.request_frames import RequestFrames
from push_predictor.nodes.server.request_log import RequestLog
from push_predictor.nodes.server.residual_tracer import ResidualTracer
from push_predictor.nodes.server.rollout_answers import answer_rollout
from push_predictor.nodes.server.status import NO_MODEL, server_status
from push_predictor_interfaces.srv import (
    ListModels,
    LoadModel,
    PredictPush,
    PredictPushBatch,
    PredictSliderPose,
    RolloutPushes,
)

SERVICE_QOS = QoSProfile(depth=1000)  # ten, the default, loses requests of a client with more in flight
Answer: TypeAlias = Callable[[ModelRegistry, Any, Any], None]  # fills the response, or raises


class InactiveError(PushPredictorError):
    """A prediction was asked of a node that is not active."""


class PredictServer(LifecycleNode):
    """Serves the models of the parameter `models`, and those that load_model brings, while it is active."""

    def __init__(self) -> None:
        super().__init__("push_predictor")
        declare(self, PARAMETERS)
        self._shelf, self._log = ModelRegistry(), RequestLog()
        self._problems: list[str] = []
        self._direct: DirectService | None = None
        self._ending = Event()  # long answers stop
        self._starting = False
        self._offered: list[Service] = []
        self._state = "unconfigured"
        self._frames = RequestFrames(self, self.value("world_frame"))
        self._tracer = ResidualTracer(self, self._deployed, lambda: float(self.value("trace_alpha")))
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._heartbeat = Heartbeat(self.value("diagnostics_period"), self._publish_diagnostics, self._silent)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)

    def start(self) -> None:
        """Configure and activate, as a lifecycle manager would; without a model the node stays inactive.

        Whoever sees the services may ask: none is answered before the node is active, or stays inactive.
        """
        self._starting = True
        if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()
        self._starting = False
        if self._direct is not None:
            self._direct.begin()

    def close(self) -> None:
        """End a trace and long answers, publish the last counts."""
        self._ending.set()
        self._tracer.close()
        self._heartbeat.end()
        self._publish_diagnostics()

    def destroy_node(self) -> None:
        """End the threads, and the node."""
        self._heartbeat.end()
        self._withdraw()
        super().destroy_node()

    # --- transitions ----------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the models and offer the services. A bad model file is reported, the others are loaded."""
        try:
            self._configure()
        except Exception:  # rclpy would drop it without a word
            self.get_logger().error(traceback.format_exc())
            self._withdraw()
            return TransitionCallbackReturn.ERROR
        return super().on_configure(state)

    def _configure(self) -> None:
        self._problems = self._shelf.load_all(self.value("models"))
        for problem in self._problems:
            self.get_logger().error(problem)
        if SHIPPED in self.value("models"):
            self.get_logger().warning("the shipped model is of a simulated square on ABS: give 'models' for your rig")
        self._shelf.choose_default(self.value("default_model"))
        self._direct = DirectService(self, PredictPush, "predict_push", self._on_push, SERVICE_QOS)
        self._offered = [
            self.create_service(PredictPushBatch, "predict_push_batch", self._on_batch, qos_profile=SERVICE_QOS),
            self.create_service(PredictSliderPose, "predict_slider_pose", self._on_pose, qos_profile=SERVICE_QOS),
            self.create_service(RolloutPushes, "rollout_pushes", self._on_rollout, qos_profile=SERVICE_QOS),
            self.create_service(ListModels, "list_models", self._on_list, qos_profile=SERVICE_QOS),
            self.create_service(LoadModel, "load_model", self._on_load, qos_profile=SERVICE_QOS),
        ]
        self._introspect(self.value("introspection"))
        self._state = "inactive"
        if not self._starting:
            self._direct.begin()

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer predictions from now on. Fails while no model is loaded: the node stays inactive."""
        if not self._shelf.names:
            self.get_logger().error(f"{NO_MODEL}; the node stays inactive")
            return TransitionCallbackReturn.FAILURE
        self._state = "active"
        self.get_logger().info(f"serving {', '.join(self._shelf.names)}; default {self._shelf.default!r}")
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Refuse predictions from now on."""
        self._state = "inactive"
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give up models and services."""
        self._give_up("unconfigured")
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give up models and services for good."""
        self._give_up("finalized")
        return super().on_shutdown(state)

    def _give_up(self, state: str) -> None:
        self._state = state
        self._tracer.end(f"the node is {state} now")
        self._withdraw()
        self._shelf, self._problems = ModelRegistry(), []
        gc.collect()  # models sit in cycles, of many MB each

    def _withdraw(self) -> None:
        if self._direct is not None:
            self._direct.close()
            self._direct = None
        while self._offered:
            self.destroy_service(self._offered.pop())

    # --- services -------------------------------------------------------------------------------------------

    def _on_push(self, request: PredictPush.Request, response: PredictPush.Response) -> PredictPush.Response:
        return self._prediction(answer_push, request, response)

    def _on_batch(
        self, request: PredictPushBatch.Request, response: PredictPushBatch.Response
    ) -> PredictPushBatch.Response:
        return self._prediction(partial(answer_batch, self._go_on), request, response)

    def _on_pose(
        self, request: PredictSliderPose.Request, response: PredictSliderPose.Response
    ) -> PredictSliderPose.Response:
        return self._prediction(partial(answer_slider_pose, self._frames), request, response)

    def _on_rollout(self, request: RolloutPushes.Request, response: RolloutPushes.Response) -> RolloutPushes.Response:
        return self._prediction(partial(answer_rollout, self._go_on, self._frames), request, response)

    def _on_list(self, request: ListModels.Request, response: ListModels.Response) -> ListModels.Response:
        answer_list(self._shelf, response)
        return response

    def _on_load(self, request: LoadModel.Request, response: LoadModel.Response) -> LoadModel.Response:
        awaited = self._state == "inactive" and not self._shelf.names
        response = self._guarded(answer_load, request, response)
        if not response.success:
            return response
        self.get_logger().info(response.message)
        gc.collect()
        if request.make_default:
            self.set_parameters([Parameter("default_model", value=response.name)])
        if awaited and self.value("autostart"):
            self.trigger_activate()
        return response

    def _prediction(self, answer: Answer, request: Any, response: Any) -> Any:
        start = perf_counter()
        response = self._guarded(answer if self._state == "active" else self._inactive, request, response)
        self._log.add(perf_counter() - start, None if response.success else response.message)
        return response

    def _go_on(self) -> None:
        """What a long answer calls now and then. Raises InactiveError when the node ends."""
        if self._ending.is_set():
            raise InactiveError("the node ends")

    def _inactive(self, shelf: ModelRegistry, request: Any, response: Any) -> None:
        raise InactiveError(f"the node is {self._state}: {'activate it' if shelf.names else NO_MODEL}")

    def _deployed(self, name: str) -> PushModel:
        """The model that a trace is about. Raises RequestError, or InactiveError."""
        if self._state != "active":
            self._inactive(self._shelf, None, None)
        return self._shelf.get(name).model

    def _guarded(self, answer: Answer, request: Any, response: Any) -> Any:
        """A callback that raises would end the node, so every failure becomes an answer."""
        try:
            answer(self._shelf, request, response)
            return response
        except PushPredictorError as error:
            reason = str(error)
            self.get_logger().warning(f"refused: {reason}", throttle_duration_sec=1.0)
        except Exception as error:
            reason = f"internal error, see the log of the node: {error!r}"
            self.get_logger().error(traceback.format_exc())
        return refuse(response, reason)

    # --- parameters and diagnostics -------------------------------------------------------------------------

    def value(self, name: str) -> Any:
        """The present value of a parameter."""
        return values_of(self, PARAMETERS)[name]

    def _check_parameters(self, changed: list[Parameter]) -> SetParametersResult:
        for parameter in changed:
            if parameter.name == "default_model" and parameter.value not in ("", *self._shelf.names):
                error = RequestError(parameter.name, parameter.value, self._shelf.accepted)
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, changed: list[Parameter]) -> None:
        for parameter in changed:
            if parameter.name == "default_model":
                self._shelf.choose_default(parameter.value)
            elif parameter.name == "introspection":
                self._introspect(parameter.value)

    def _introspect(self, mode: str) -> None:
        direct = [self._direct.service] if self._direct is not None else []
        for service in [*direct, *self._offered]:
            service.configure_introspection(self.get_clock(), qos_profile_system_default, INTROSPECTION[mode])

    def _silent(self, error: Exception) -> None:
        self.get_logger().error(f"no diagnostics: {error!r}", throttle_duration_sec=10.0)

    def _publish_diagnostics(self) -> None:
        name = self.get_fully_qualified_name()
        status = server_status(name, self._state, self._shelf, self._problems, self._log)
        self._diagnostics.publish(diagnostic_array(self.get_clock().now().nanoseconds, status))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; answers the exit status."""
    return run("predict_server", started_server, args)


def started_server(stop: Stop) -> PredictServer:
    """The node, serving if its parameter `autostart` says so. Raises RequestError for a bad parameter."""
    node = PredictServer()
    if node.value("autostart"):
        node.start()
    return node


if __name__ == "__main__":
    sys.exit(main())
