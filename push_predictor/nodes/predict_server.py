# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The node predict_server: seven services, the actions suggest_pushes and trace_residual (docs/reference)."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before the other imports: they take half a second, in which a signal may arrive
    from push_predictor.nodes import entry

    sys.exit(entry.predict_server())

import gc
import os
import threading
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from threading import Event
from time import monotonic, perf_counter
from typing import Any, TypeAlias

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, qos_profile_system_default
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState

from msg_adapters.diagnostics import diagnostic_array
from push_predictor.errors import InactiveError, PushPredictorError, RequestError
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.nodes.parameter_tables import PREDICT_SERVER
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.runtime import refusal, run
from push_predictor.nodes.server.actions import GuardedAction, TraceAction
from push_predictor.nodes.server.adaptation import AdaptedModels
from push_predictor.nodes.server.services import (
    RequestFrames,
    handle_list_models,
    handle_load_model,
    handle_predict_push,
    handle_predict_push_batch,
    handle_predict_slider_pose,
    handle_rollout_pushes,
    handle_suggest_pushes,
)
from push_predictor.nodes.server.status import NO_MODEL, RequestStatistics, server_status
from push_predictor.nodes.server.threaded_service import ThreadedService
from push_predictor.resources import SHIPPED
from push_predictor_interfaces.action import SuggestPushes
from push_predictor_interfaces.srv import (
    AdaptModel,
    ListModels,
    LoadModel,
    PredictPush,
    PredictPushBatch,
    PredictSliderPose,
    RolloutPushes,
)

SERVICE_QOS = QoSProfile(depth=1000)  # the default, 10, loses requests of a client with more in flight
SIMULATED = "the default model was trained on a simulated square on ABS: set the parameter 'models' to one of your rig"
CLOSE_TIMEOUT = 5.0  # s in which long requests end and their answers are sent when the node ends
NICENESS = 10  # of 19, for the tables of models: what answers requests comes first
INTROSPECTION = {
    "disabled": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}
Handler: TypeAlias = Callable[[ModelRegistry, Any, Any], None]  # fills the response, or raises


class PredictServer(LifecycleNode):
    """Predicts with the models of the parameter `models` and those loaded by load_model, while it is active.

    threads: of its executor, for what may take long: a batch, a rollout, a loading and the actions, one of each.
    """

    threads = 16

    def __init__(self) -> None:
        super().__init__("push_predictor")
        declare(self, PREDICT_SERVER)
        self._registry, self._statistics = ModelRegistry(), RequestStatistics()
        self._problems: list[str] = []
        self._closing, self._closing_until = Event(), 0.0
        self._starting = False
        self._state = "unconfigured"
        self._first_default = self.value("default_model")
        self._frames = RequestFrames(self, self.value("world_frame"))
        self._adapted = AdaptedModels(self, lambda: self._registry, self.value("adapt_mechanisms"))
        self._create_services()
        self._introspect(self.value("introspection"))
        check, alpha = self._check_active, lambda: float(self.value("trace_alpha"))
        self._actions = [
            TraceAction(self, lambda name: self._registry.get(name).model, alpha, check, self._check_loaded),
            GuardedAction(self, SuggestPushes, "suggest_pushes", self._suggest, check, check),
        ]
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        period, steady = self.value("diagnostics_period"), Clock(clock_type=ClockType.STEADY_TIME)
        apart = MutuallyExclusiveCallbackGroup()
        self._timer = self.create_timer(period, self._publish_diagnostics, apart, clock=steady)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)

    def start(self) -> None:
        """With `autostart` configure and activate, as a lifecycle manager would; then answer requests.

        Without a model the node stays inactive. Requests queue until then, so that no early client is refused.
        """
        if self.value("autostart"):
            self._starting = True
            if self.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                self.trigger_activate()
            self._starting = False
            self._complete_models()
        self._push_service.start()

    def finish(self) -> bool:
        """End long requests and goals; whether their clients have got the answers, or will not be waited for."""
        self._closing.set()
        self._closing_until = self._closing_until or monotonic() + CLOSE_TIMEOUT
        return not self.abandons_callbacks or monotonic() > self._closing_until

    @property
    def abandons_callbacks(self) -> bool:
        """Whether a long request or a transition still runs: the process cannot wait for it when it ends."""
        one_of_each_group = (*self._long_services, self._short_services[0], self._timer)  # a short one: transitions too
        idle = all(each.callback_group.can_execute(each) for each in one_of_each_group)
        return not (idle and all(action.settled for action in self._actions))

    def close(self) -> None:
        """Publish the last diagnostics."""
        self._closing.set()
        self._publish_diagnostics()

    def destroy_node(self) -> None:
        """End the thread of predict_push, destroy the node."""
        self._push_service.close()
        super().destroy_node()

    def _complete_models(self) -> None:
        """Compute the tables that the models lack, in the background; they predict exactly meanwhile."""
        registry = self._registry

        def complete() -> None:
            with suppress(OSError, AttributeError):  # Linux has a priority for each thread, others for the process
                os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
            try:
                registry.complete(lambda: self._closing.is_set() or self._registry is not registry)
            except Exception as error:
                self.get_logger().error(f"a model predicts without its table: {error!r}")

        threading.Thread(target=complete, name="tables", daemon=True).start()

    # --- transitions ----------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Load the models. A bad model file is reported, the others are loaded."""
        try:
            self._configure()
        except Exception:  # rclpy would ignore it silently
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.ERROR
        return super().on_configure(state)

    def _configure(self) -> None:
        self._problems = self._registry.load_all(self.value("models"), at_once=self._starting)
        for problem in self._problems:
            self.get_logger().error(problem)
        if SHIPPED in self.value("models"):
            self.get_logger().warning(SIMULATED)
        self._registry.choose_default(self.value("default_model"))
        self._state = "inactive"

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Answer predictions from now on. Fails while no model is loaded; the node then stays inactive."""
        if not self._registry.names:
            self.get_logger().error(f"the node stays inactive: {NO_MODEL}")
            return TransitionCallbackReturn.FAILURE
        self._state = "active"
        if self.value("adapt"):
            self._adapt()
        models = ", ".join(self._registry.names)
        self.get_logger().info(f"active with the models {models}; default {self._registry.default!r}")
        return super().on_activate(state)

    def _adapt(self) -> None:
        """Let the default model follow; a model that cannot is reported, and predicts as it is."""
        try:
            self._adapted.start("")
        except PushPredictorError as error:
            self._problems.append(f"adapt: {error}")
            self.get_logger().error(self._problems[-1])

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Refuse predictions from now on."""
        self._state = "inactive"
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unload the models, forget the default that was set since the start."""
        self._unload("unconfigured")
        self.set_parameters([Parameter("default_model", value=self._first_default)])
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Unload the models for good."""
        self._unload("finalized")
        return super().on_shutdown(state)

    def _unload(self, state: str) -> None:
        self._state = state
        self._registry, self._problems = ModelRegistry(), []
        gc.collect()  # models contain reference cycles and take many MB each

    # --- services -------------------------------------------------------------------------------------------

    def _create_services(self) -> None:
        """Long requests each have a callback group: neither they nor what takes microseconds wait for one another."""
        batch = partial(handle_predict_push_batch, self._check_active)
        rollout = partial(handle_rollout_pushes, self._check_active, self._frames)
        pose = partial(handle_predict_slider_pose, self._frames)
        self._on_push = self._prediction(handle_predict_push)
        self._on_load, self._on_list = self._guarded(self._load), self._guarded(handle_list_models)
        self._push_service = ThreadedService(self, PredictPush, "predict_push", self._on_push, SERVICE_QOS)
        self._long_services = [
            self._offer(kind, name, callback, MutuallyExclusiveCallbackGroup())
            for kind, name, callback in (
                (PredictPushBatch, "predict_push_batch", self._prediction(batch)),
                (RolloutPushes, "rollout_pushes", self._prediction(rollout)),
                (LoadModel, "load_model", self._on_load),
                (AdaptModel, "adapt_model", self._guarded(self._adapted.handle)),
            )
        ]
        self._short_services = [
            self._offer(PredictSliderPose, "predict_slider_pose", self._prediction(pose)),
            self._offer(ListModels, "list_models", self._on_list),
        ]
        for service in self.services:
            if service.service_name.endswith("/change_state"):
                service.callback = self._refusing(service.callback)
        self._loaded: Callable[[], None] = lambda: None
        self._use_loaded = self.create_guard_condition(lambda: self._loaded())

    def _refusing(self, change: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """The service ~/change_state of rclpy, which lets an impossible transition raise and so end the node."""

        def answer(request: Any, response: Any) -> Any:
            try:
                return change(request, response)
            except RuntimeError as error:  # RCLError has no public name
                asked = request.transition.label or request.transition.id
                self.get_logger().warning(f"transition: {asked!r} is not accepted in state {self._state!r}: {error}")
                response.success = False
                return response

        return answer

    def _offer(self, kind: Any, name: str, callback: Any, group: CallbackGroup | None = None) -> Service:
        return self.create_service(kind, name, callback, qos_profile=SERVICE_QOS, callback_group=group)

    def _load(self, registry: ModelRegistry, request: Any, response: Any) -> None:
        """Load a model and take it into use. Raises PushPredictorError."""
        self._check_loaded()
        was_empty = not registry.names
        handle_load_model(registry, request, response)
        self.get_logger().info(response.message)
        gc.collect()
        self._in_default_group(registry, partial(self._use, response.name, request.make_default, was_empty))

    def _use(self, name: str, as_default: bool, was_empty: bool) -> None:
        if as_default:
            (done,) = self.set_parameters([Parameter("default_model", value=name)])
            if not done.successful:
                raise InactiveError(done.reason)
        if was_empty and self._state == "inactive" and self.value("autostart"):
            self.trigger_activate()

    def _in_default_group(self, registry: ModelRegistry, work: Callable[[], None]) -> None:
        """Do some work in turn with the calls that change parameters and states, and wait for it.

        Raises what the work raises, and InactiveError where the models are unloaded meanwhile.
        """
        done, errors = Event(), list[Exception]()

        def guarded() -> None:
            try:
                if self._registry is registry:
                    work()
            except Exception as error:
                errors.append(error)
            done.set()

        self._loaded = guarded
        if self.executor is None:
            guarded()
        else:
            self._use_loaded.trigger()
        while not done.wait(0.1):
            self._check_loaded()
        if errors:
            raise errors[0]
        if self._registry is not registry:
            raise InactiveError(f"the node is {self._state}")

    def _suggest(self, goal: Any, check_cancelled: Callable[[], None]) -> SuggestPushes.Result:
        """The result of a goal; the pushes chosen so far are its feedback."""
        chosen = -1

        def check() -> None:  # called before each push
            nonlocal chosen
            check_cancelled()
            if (chosen := chosen + 1) > 0:
                goal.publish_feedback(SuggestPushes.Feedback(chosen=chosen))

        handle_suggest_pushes(check, self._registry, goal.request, result := SuggestPushes.Result())
        return result

    def _prediction(self, handler: Handler) -> Callable[[Any, Any], Any]:
        """The callback of a service that predicts while the node is active, and is counted."""

        def active(registry: ModelRegistry, request: Any, response: Any) -> None:
            if self._state != "active":
                raise InactiveError(f"the node is {self._state}: {'activate it' if registry.names else NO_MODEL}")
            handler(registry, request, response)

        answer = self._guarded(active)

        def callback(request: Any, response: Any) -> Any:
            start = perf_counter()
            response = answer(request, response)
            self._statistics.add(perf_counter() - start, None if response.success else response.message)
            return response

        return callback

    def _check_active(self) -> None:
        """Raise InactiveError when the node ends or is not active; long requests call it between their parts."""
        self._check_state("active")

    def _check_loaded(self) -> None:
        """Raise InactiveError when the node ends or its models are unloaded."""
        self._check_state("active", "inactive")

    def _check_state(self, *accepted: str) -> None:
        if self._closing.is_set():
            raise InactiveError("the node ends")
        if self._state not in accepted:
            raise InactiveError(f"the node is {self._state}")

    def _guarded(self, handler: Handler) -> Callable[[Any, Any], Any]:
        """The callback of a service; every exception becomes a refusal."""

        def callback(request: Any, response: Any) -> Any:
            try:
                handler(self._registry, request, response)
                return response
            except Exception as error:
                return refusal(error, response, self.get_logger())

        return callback

    # --- parameters and diagnostics -------------------------------------------------------------------------

    def value(self, name: str) -> Any:
        """The present value of a parameter."""
        return values_of(self, PREDICT_SERVER)[name]

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
        for service in [self._push_service.service, *self._long_services, *self._short_services]:
            service.configure_introspection(self.get_clock(), qos_profile_system_default, INTROSPECTION[mode])

    def _publish_diagnostics(self) -> None:
        name = self.get_fully_qualified_name()
        status = server_status(name, self._state, self._registry, self._problems, self._statistics)
        adapted = [status for status in (self._adapted.status(),) if status is not None]
        self._diagnostics.publish(diagnostic_array(self.get_clock().now().nanoseconds, status, *adapted))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; returns the exit status."""
    return run("predict_server", lambda stop: PredictServer(), args)
