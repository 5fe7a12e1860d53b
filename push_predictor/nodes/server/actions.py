# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The actions of predict_server: one goal at a time, in a thread of the executor, and trace_residual.

A trace runs in a process of its own (online.trace_process), which the thread watches.
"""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from msg_adapters.predictions import refuse
from push_predictor.error_codes import ErrorCode
from push_predictor.errors import BusyError, InactiveError, PushPredictorError, RecordingError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import save_model
from push_predictor.nodes.runtime import refusal
from push_predictor.online.child_process import Child, Failure
from push_predictor.online.trace_process import (
    EXTENDED,
    RESULTS,
    Stage,
    Traced,
    TraceTask,
    evidence_in,
    for_client,
    run_trace,
)
from push_predictor_interfaces.action import TraceResidual

SENDING = 0.2  # s in which the executor sends a result after the end of its goal
POLL_PERIOD = 0.05  # s between two looks at whether the goal is still wanted
EVIDENCE = "pushes.csv as push_validator writes it, push tables or recordings"


class CancelledError(PushPredictorError):
    """The client cancelled the goal."""


class GuardedAction:
    """An action server of a node. doing: what it does for the present goal, in words, for the client of another one.

    work: called with a goal handle and a function that raises when nobody waits any more, to be called often; returns
    the result. may_begin, may_continue: raise InactiveError unless the node may accept a goal, continue with one.
    """

    def __init__(
        self,
        node: Node,
        kind: Any,
        name: str,
        work: Callable[[Any, Callable[[], None]], Any],
        may_begin: Callable[[], None],
        may_continue: Callable[[], None],
    ) -> None:
        self._log, self._kind, self._name = node.get_logger(), kind, name
        self._work, self._may_begin, self._may_continue = work, may_begin, may_continue
        self._running, self._ended = threading.Lock(), -SENDING
        self._counting, self._goals = threading.Lock(), 0  # accepted, without a result
        self.doing = ""
        ActionServer(
            node,
            kind,
            name,
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=lambda request: GoalResponse.ACCEPT if self._accepts() else GoalResponse.REJECT,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    @property
    def settled(self) -> bool:
        """Whether no goal is accepted or runs, and the last result has been sent."""
        return not self._goals and monotonic() - self._ended > SENDING

    def _accepts(self) -> bool:
        """Whether a goal is accepted now; ROS gives a client no reason for a rejected goal, so the log has it."""
        self._count(1)  # before the check: a node that ends sees the goal, or the goal that the node ends
        try:
            self._may_begin()
        except InactiveError as error:
            self._count(-1)
            self._log.warning(f"{self._name}: goal rejected, {error}")
            return False
        return True

    def _count(self, change: int) -> None:
        with self._counting:
            self._goals += change

    def _execute(self, goal: Any) -> Any:
        try:
            return self._result(goal)
        finally:
            self._ended = monotonic()
            self._count(-1)

    def _result(self, goal: Any) -> Any:
        if not self._running.acquire(blocking=False):
            accepted = f"one at a time: {self.doing or self._name} is under way, wait or cancel it"
            return self._abort(goal, BusyError(f"goal: {self._name!r} is not accepted, give {accepted}"))
        try:
            result = self._work(goal, partial(self._check, goal))
            (goal.succeed if result.success else goal.abort)()
            return result
        except CancelledError as error:
            goal.canceled()
            return refuse(self._kind.Result(), str(error), ErrorCode.CANCELLED)
        except Exception as error:
            return self._abort(goal, error)
        finally:
            self.doing = ""
            self._running.release()

    def _check(self, goal: Any) -> None:
        if goal.is_cancel_requested:
            raise CancelledError("cancelled: nothing was written or changed")
        self._may_continue()

    def _abort(self, goal: Any, error: Exception) -> Any:
        goal.abort()
        return refusal(error, self._kind.Result(), self._log)


class TraceAction(GuardedAction):
    """trace_residual. model_of: the model of a name, or raises PushPredictorError; alpha: the present level.

    may_begin, may_continue: see GuardedAction.
    """

    def __init__(
        self,
        node: Node,
        model_of: Callable[[str], PushModel],
        alpha: Callable[[], float],
        may_begin: Callable[[], None],
        may_continue: Callable[[], None],
    ) -> None:
        super().__init__(node, TraceResidual, "trace_residual", self._trace, may_begin, may_continue)
        self._model_of, self._alpha = model_of, alpha

    def _trace(self, goal: Any, check: Callable[[], None]) -> TraceResidual.Result:
        """Trace the pushes of a goal. Raises PushPredictorError or OSError that states what is wrong with it."""
        request = goal.request
        model = self._model_of(request.model)
        self.doing = f"the trace of {model.name}"
        if not request.output:
            raise RequestError("output", "", "the folder for report, verdict and extended model")
        output = Path(request.output).expanduser().absolute()
        evidence = _evidence("data" if request.data else "output", request.data or request.output)
        _publish(goal, Stage("recorded pushes", 0.0))
        output.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".trace-", dir=output, ignore_cleanup_errors=True) as work:
            folder = Path(work)
            self._log.info(f"tracing {model.name} on {', '.join(map(str, evidence))}")
            deployed = folder / "deployed.pushmodel"
            save_model(model, deployed)  # pickled, a model has all its matrices, and changes while it predicts
            task = TraceTask(evidence, deployed, tuple(request.covariates), self._alpha(), folder)
            ended = _watched(goal, check, task)
            if isinstance(ended, Failure):
                reason = for_client(ended.reason, task)
                return TraceResidual.Result(success=False, message=reason, error_code=int(ended.code))
            for name in RESULTS:
                if (folder / name).exists():
                    (folder / name).replace(output / name)
        result = _result(ended, output / EXTENDED)
        self._log.info(result.message)
        _publish(goal, Stage("done", 1.0))
        return result


def _evidence(field: str, given: str) -> tuple[Path, ...]:
    """The data of a folder or file to trace. Raises RecordingError that names the field of the goal."""
    place = Path(given).expanduser().absolute()
    if not (found := evidence_in(place)):
        raise RecordingError(f"{field} {place}: no data to trace; give {EVIDENCE}")
    return found


def _watched(goal: Any, check: Callable[[], None], task: TraceTask) -> Traced | Failure:
    """The last message of the process; its stages become feedback. Raises what `check` raises, after its end."""
    child = Child("trace", run_trace)
    child.start(task)
    try:
        while True:
            check()
            received: Stage | Traced | Failure | None = child.received(POLL_PERIOD)
            if isinstance(received, Stage):
                _publish(goal, received)
            elif received is not None:
                return received
    finally:
        child.stop(at_once=True)


def _publish(goal: Any, stage: Stage) -> None:
    goal.publish_feedback(TraceResidual.Feedback(stage=stage.name, progress=stage.share))


def _result(traced: Traced, extended: Path) -> TraceResidual.Result:
    result = TraceResidual.Result(success=True, message=traced.message, verdict=traced.verdict)
    if traced.needs is not None:
        result.extended_model = str(extended)
        needs = ", ".join(traced.needs) or "no covariates"
        result.message += f" Load {result.extended_model} with load_model to use it; its requests need {needs}."
    return result
