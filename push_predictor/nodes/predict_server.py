# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The node predict_server: seven services and the action trace_residual (docs/reference/predict_server.md)."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before the other imports: they take half a second, in which a signal may arrive
    from push_predictor.nodes import entry

    sys.exit(entry.predict_server())

import gc
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
from push_predictor.error_codes import ErrorCode, error_code
from push_predictor.errors import InactiveError, PushPredictorError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.runtime import run
from push_predictor.nodes.server.background import in_background
from push_predictor.nodes.server.model_services import handle_list_models, handle_load_model
from push_predictor.nodes.server.parameters import INTROSPECTION, PARAMETERS
from push_predictor.nodes.server.prediction_services import handle_predict_push, handle_predict_push_batch
from push_predictor.nodes.server.request_frames import RequestFrames
from push_predictor.nodes.server.rollout_service import handle_rollout_pushes
from push_predictor.nodes.server.slider_pose_service import handle_predict_slider_pose
from push_predictor.nodes.server.status import NO_MODEL, server_status
from push_predictor.nodes.server.suggest_service import handle_suggest_pushes
from push_predictor.nodes.server.threaded_service import ThreadedService
from push_predictor.nodes.server.trace_action import TraceAction
from push_predictor.online.periodic_thread import PeriodicThread
from push_predictor.online.request_statistics import RequestStatistics
from push_predictor.resources import SHIPPED
from push_predictor_interfaces.srv import (
    ListModels,
    LoadModel,
    PredictPush,
    PredictPushBatch,
    PredictSliderPose,
    RolloutPushes,
    SuggestPushes,
)

SERVICE_QOS = QoSProfile(depth=1000)  # the default, 10, loses requests of a client with more in flight
SIMULATED = "the default model was trained on a simulated square on ABS: set the parameter 'models' to one of your rig"
Handler: TypeAlias = Callable[[ModelRegistry, Any, Any], None]  # fills the response, or raises


class PredictServer(LifecycleNode):
    """Predicts with the models of the parameter `models` and those loaded by load_model, while it is active."""

    def __init__(self) -> None:
        super().__init__("push_predictor")
        declare(self, PARAMETERS)
        self._registry, self._statistics = ModelRegistry(), RequestStatistics()
        self._problems: list[str] = []
        self._threaded: list[ThreadedService] = []
        self._other_services: list[Service] = []
        self._closing = Event()
        self._starting = False
        self._state = "unconfigured"
        self._first_default = self.value("default_model")
        self._frames = RequestFrames(self, self.value("world_frame"))
        self._trace = TraceAction(self, self._deployed, lambda: float(self.value("trace_alpha")), lambda: self._state)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._diagnostics_thread = PeriodicThread(
            self.value("diagnostics_period"), self._publish_diagnostics, self._log_diagnostics_error
        )
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)

    def start(self) -> None:
        """Configure and activate, as a lifecycle manager would; without a model the node stays inactive.

        predictions queue until the activation is over, so that no early client is refused.
        """
        self._starting = True
        if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self.trigger_activate()
        self._starting = False
        self._start_threaded()
        self._complete_models()

    def finish(self) -> bool:
        """End a trace and long requests; whether their clients have got the results."""
        self._closing.set()
        return self._trace.finish()

    def close(self) -> None:
        """Publish the last diagnostics."""
        self._closing.set()
        self._trace.close()
        self._diagnostics_thread.stop()
        self._publish_diagnostics()

    def destroy_node(self) -> None:
        """End the threads, destroy the services and the node."""
        self._diagnostics_thread.stop()
        self._destroy_services()
        super().destroy_node()

    def _complete_models(self) -> None:
        """Compute the tables that the models lack, in the background; they predict exactly meanwhile."""
        registry = self._registry
        in_background(lambda: registry.complete(self._closing.is_set), self._log_completion_error)

    def _log_completion_error(self, error: Exception) -> None:
        self.get_logger().error(f"a model predicts without its table: {error!r}")

    # --- transitions ----------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the models and create the services. A bad model file is reported, the others are loaded."""
        try:
            self._configure()
        except Exception:  # rclpy would ignore it silently
            self.get_logger().error(traceback.format_exc())
            self._destroy_services()
            return TransitionCallbackReturn.ERROR
        return super().on_configure(state)

    def _configure(self) -> None:
        self._problems = self._registry.load_all(self.value("models"), at_once=self._starting)
        for problem in self._problems:
            self.get_logger().error(problem)
        if SHIPPED in self.value("models"):
            self.get_logger().warning(SIMULATED)
        self._registry.choose_default(self.value("default_model"))
        self._create_services()
        self._introspect(self.value("introspection"))
        self._state = "inactive"
        if not self._starting:
            self._start_threaded()

    def _create_services(self) -> None:
        # In threads: what must be fast, and what may take seconds, so that nothing else waits for it.
        self._threaded = [
            ThreadedService(self, kind, name, callback, SERVICE_QOS)
            for kind, name, callback in (
                (PredictPush, "predict_push", self._on_push),
                (PredictPushBatch, "predict_push_batch", self._on_batch),
                (RolloutPushes, "rollout_pushes", self._on_rollout),
                (SuggestPushes, "suggest_pushes", self._on_suggest),
                (LoadModel, "load_model", self._on_load),
            )
        ]
        self._other_services = [
            self.create_service(kind, name, callback, qos_profile=SERVICE_QOS)
            for kind, name, callback in (
                (PredictSliderPose, "predict_slider_pose", self._on_pose),
                (ListModels, "list_models", self._on_list),
            )
        ]

    def _start_threaded(self) -> None:
        for service in self._threaded:
            service.start()

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer predictions from now on. Fails while no model is loaded; the node then stays inactive."""
        if not self._registry.names:
            self.get_logger().error(f"the node stays inactive: {NO_MODEL}")
            return TransitionCallbackReturn.FAILURE
        self._state = "active"
        models = ", ".join(self._registry.names)
        self.get_logger().info(f"active with the models {models}; default {self._registry.default!r}")
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Refuse predictions from now on."""
        self._state = "inactive"
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unload the models, forget the default that was set since the start, destroy the services."""
        self._unload("unconfigured")
        self.set_parameters([Parameter("default_model", value=self._first_default)])
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unload the models and destroy the services for good."""
        self._unload("finalized")
        return super().on_shutdown(state)

    def _unload(self, state: str) -> None:
        self._state = state
        self._trace.abort(f"the node is {state} now")
        self._registry, self._problems = ModelRegistry(), []  # before the services end: a loading must not wait for us
        self._destroy_services()
        gc.collect()  # models contain reference cycles and take many MB each

    def _destroy_services(self) -> None:
        while self._threaded:
            self._threaded.pop().close()
        while self._other_services:
            self.destroy_service(self._other_services.pop())

    # --- services -------------------------------------------------------------------------------------------

    def _on_push(self, request: PredictPush.Request, response: PredictPush.Response) -> PredictPush.Response:
        return self._prediction(handle_predict_push, request, response)

    def _on_batch(
        self, request: PredictPushBatch.Request, response: PredictPushBatch.Response
    ) -> PredictPushBatch.Response:
        return self._prediction(partial(handle_predict_push_batch, self._check_cancelled), request, response)

    def _on_pose(
        self, request: PredictSliderPose.Request, response: PredictSliderPose.Response
    ) -> PredictSliderPose.Response:
        return self._prediction(partial(handle_predict_slider_pose, self._frames), request, response)

    def _on_rollout(self, request: RolloutPushes.Request, response: RolloutPushes.Response) -> RolloutPushes.Response:
        return self._prediction(partial(handle_rollout_pushes, self._check_cancelled, self._frames), request, response)

    def _on_suggest(self, request: SuggestPushes.Request, response: SuggestPushes.Response) -> SuggestPushes.Response:
        return self._prediction(partial(handle_suggest_pushes, self._check_cancelled), request, response)

    def _on_list(self, request: ListModels.Request, response: ListModels.Response) -> ListModels.Response:
        return self._guarded(handle_list_models, request, response)

    def _on_load(self, request: LoadModel.Request, response: LoadModel.Response) -> LoadModel.Response:
        return self._guarded(self._load, request, response)

    def _load(self, registry: ModelRegistry, request: Any, response: Any) -> None:
        """Load a model and take it into use. Raises PushPredictorError."""
        was_empty = not registry.names
        handle_load_model(registry, request, response)
        self.get_logger().info(response.message)
        gc.collect()
        self._in_executor(registry, partial(self._use, response.name, request.make_default, was_empty))

    def _use(self, name: str, as_default: bool, was_empty: bool) -> None:
        if as_default:
            (done,) = self.set_parameters([Parameter("default_model", value=name)])
            if not done.successful:
                raise InactiveError(done.reason)
        if was_empty and self._state == "inactive" and self.value("autostart"):
            self.trigger_activate()

    def _in_executor(self, registry: ModelRegistry, work: Callable[[], None]) -> None:
        """Let the executor do some work and wait for it: parameters and states are changed in its thread only.

        Raises what the work raises, and InactiveError where the models are unloaded meanwhile.
        """
        if self.executor is None:
            work()
            return
        done, errors = Event(), list[Exception]()

        def guarded() -> None:
            try:
                if self._registry is registry:
                    work()
            except Exception as error:
                errors.append(error)
            done.set()

        self.executor.create_task(guarded)
        while not done.wait(0.1):
            if self._closing.is_set() or self._registry is not registry:
                raise InactiveError(f"the node is {self._state}")
        if errors:
            raise errors[0]
        if self._registry is not registry:
            raise InactiveError(f"the node is {self._state}")

    def _prediction(self, handler: Handler, request: Any, response: Any) -> Any:
        start = perf_counter()
        response = self._guarded(handler if self._state == "active" else self._refuse_inactive, request, response)
        self._statistics.add(perf_counter() - start, None if response.success else response.message)
        return response

    def _check_cancelled(self) -> None:
        """Raise InactiveError when the node ends or is not active; long requests call it between their parts."""
        if self._closing.is_set():
            raise InactiveError("the node ends")
        if self._state != "active":
            raise InactiveError(f"the node is {self._state}")

    def _refuse_inactive(self, registry: ModelRegistry, request: Any, response: Any) -> None:
        raise InactiveError(f"the node is {self._state}: {'activate it' if registry.names else NO_MODEL}")

    def _deployed(self, name: str) -> PushModel:
        """The model to be traced. Raises RequestError."""
        return self._registry.get(name).model

    def _guarded(self, handler: Handler, request: Any, response: Any) -> Any:
        """Turn every exception into a refusal: one that left a callback would end the node."""
        try:
            handler(self._registry, request, response)
            return response
        except PushPredictorError as error:
            reason, code = str(error), error_code(error)
            self.get_logger().warning(f"refused: {reason}", throttle_duration_sec=1.0)
        except Exception as error:
            reason, code = f"internal error, see the log of the node: {error!r}", ErrorCode.INTERNAL_ERROR
            self.get_logger().error(traceback.format_exc())
        return refuse(response, reason, code)

    # --- parameters and diagnostics -------------------------------------------------------------------------

    def value(self, name: str) -> Any:
        """The present value of a parameter."""
        return values_of(self, PARAMETERS)[name]

    def _check_parameters(self, changed: list[Parameter]) -> SetParametersResult:
        for parameter in changed:
            known = self._state == "unconfigured" or parameter.value in ("", *self._registry.names)
            if parameter.name == "default_model" and not known:
                error = RequestError(parameter.name, parameter.value, self._registry.accepted)
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, changed: list[Parameter]) -> None:
        for parameter in changed:
            if parameter.name == "default_model":
                self._registry.choose_default(parameter.value)
            elif parameter.name == "introspection":
                self._introspect(parameter.value)

    def _introspect(self, mode: str) -> None:
        for service in [*(threaded.service for threaded in self._threaded), *self._other_services]:
            service.configure_introspection(self.get_clock(), qos_profile_system_default, INTROSPECTION[mode])

    def _log_diagnostics_error(self, error: Exception) -> None:
        self.get_logger().error(f"diagnostics could not be published: {error!r}", throttle_duration_sec=10.0)

    def _publish_diagnostics(self) -> None:
        name = self.get_fully_qualified_name()
        status = server_status(name, self._state, self._registry, self._problems, self._statistics)
        self._diagnostics.publish(diagnostic_array(self.get_clock().now().nanoseconds, status))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; returns the exit status."""
    return run("predict_server", lambda stop: PredictServer(), args, start=start_server)


def start_server(node: PredictServer) -> None:
    """Activate the node if its parameter `autostart` is true."""
    if node.value("autostart"):
        node.start()
