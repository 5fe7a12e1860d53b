# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The action trace_residual: explain what a model fails to predict in recorded pushes, while predictions go on.

The trace runs in a process of its own (online.trace_process). Here its goal is accepted, watched, cancelled and ended.
"""

from __future__ import annotations

import shutil
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from push_predictor.error_codes import ErrorCode, error_code
from push_predictor.errors import BusyError, PushPredictorError, RecordingError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import save_model
from push_predictor.nodes.runtime import one_line
from push_predictor.nodes.server.deferred_action import DeferredAction
from push_predictor.nodes.server.validator_folder import ValidatorFolder
from push_predictor.online.trace_process import (
    EXTENDED,
    RESULTS,
    Failed,
    Stage,
    Traced,
    TraceTask,
    evidence_in,
    start_trace,
)
from push_predictor_interfaces.action import TraceResidual

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

POLL_PERIOD = 0.05  # s between two looks at the trace's process
CLOSE_TIMEOUT = 5.0  # s in which the executor ends a trace and sends the result when the node ends
EVIDENCE = "pushes.csv as push_validator writes it, push tables or recordings"


@dataclass(eq=False)
class _Job:
    """An active goal. It first waits for a validator's folder (no pipe), then for its process."""

    goal: Any
    model: PushModel
    alpha: float
    output: Path
    folder: Path | None = None
    process: BaseProcess | None = None
    pipe: Connection | None = None
    stage: str = ""


class TraceAction:
    """One trace at a time. model_of: the model of a name, or raises PushPredictorError; alpha: the present level.

    state: the present state of the node; goals are rejected unless it is active.
    """

    def __init__(
        self,
        node: Node,
        model_of: Callable[[str], PushModel],
        alpha: Callable[[], float],
        state: Callable[[], str],
    ) -> None:
        self._node, self._model_of, self._alpha, self._state = node, model_of, alpha, state
        self._job: _Job | None = None
        self._timer: Any = None
        self._closing_until: float | None = None
        self._validator = ValidatorFolder(node)
        self._action = DeferredAction(node, TraceResidual, "trace_residual", self._accepts, self._on_goal)

    def finish(self) -> bool:
        """End a running trace; whether its client has got the result, or will not be waited for."""
        self._closing_until = self._closing_until or monotonic() + CLOSE_TIMEOUT
        return (self._job is None and self._action.result_sent) or monotonic() > self._closing_until

    def close(self) -> None:
        """End what is left of a trace: no client can get a result any more."""
        if self._job is not None:
            _clear(self._job)

    def abort(self, reason: str) -> None:
        """End a running trace because the node is no longer active; its client gets the reason."""
        if self._job is not None:
            self._abort(self._job.goal, reason, ErrorCode.NOT_ACTIVE)

    # --- a goal ---------------------------------------------------------------------------------------------

    def _accepts(self) -> bool:
        """Whether the node is active; ROS gives a client no reason for a rejected goal, so the log has it."""
        if (state := self._state()) != "active":
            self._node.get_logger().warning(f"trace_residual: goal rejected, the node is {state}")
        return state == "active"

    def _on_goal(self, goal: Any) -> None:
        self._guarded(goal, lambda: self._begin(goal))

    def _begin(self, goal: Any) -> None:
        """Accept the goal. Raises PushPredictorError or OSError that states what is wrong with it."""
        if self._job is not None:
            running = f"{self._job.model.name} ({self._job.stage})"
            accepted = f"one at a time: {running} is being traced, wait or cancel it"
            raise BusyError(f"goal: 'trace_residual' is not accepted, give {accepted}")
        request = goal.request
        model = self._model_of(request.model)
        if not request.output:
            raise RequestError("output", "", "the folder for report, verdict and extended model")
        output = Path(request.output).expanduser().absolute()
        self._job = job = _Job(goal, model, self._alpha(), output)
        self._timer = self._node.create_timer(POLL_PERIOD, self._poll, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._publish(Stage("recorded pushes", 0.0))
        if evidence := evidence_in(output):
            self._start(job, evidence)
        else:
            self._validator.start()

    def _start(self, job: _Job, evidence: tuple[Path, ...]) -> None:
        """Start the process, with its work folder inside the output folder."""
        job.output.mkdir(parents=True, exist_ok=True)
        job.folder = Path(tempfile.mkdtemp(prefix=".trace-", dir=job.output))
        model = job.folder / "deployed.pushmodel"
        save_model(job.model, model)  # the model in use; its original file may have changed since
        task = TraceTask(evidence, model, tuple(job.goal.request.covariates), job.alpha, job.folder)
        job.process, job.pipe = start_trace(task)
        self._node.get_logger().info(f"tracing {job.model.name} on {', '.join(map(str, evidence))}")

    # --- its progress ---------------------------------------------------------------------------------------

    def _poll(self) -> None:
        if (job := self._job) is None:
            return
        if job.goal.is_cancel_requested:
            self._finish(job.goal, job.goal.canceled, _result("cancelled: nothing was written", ErrorCode.CANCELLED))
        elif self._closing_until is not None:
            self._abort(job.goal, "the node ends: nothing was written", ErrorCode.NOT_ACTIVE)
        else:
            self._guarded(job.goal, lambda: self._advance(job))

    def _advance(self, job: _Job) -> None:
        if job.pipe is None:
            self._poll_validator(job)
        while self._job is job and job.pipe is not None and job.pipe.poll():
            self._receive(job, job.pipe)

    def _guarded(self, goal: Any, work: Callable[[], None]) -> None:
        """Abort the goal for every exception: one that left a callback would end the node."""
        try:
            work()
        except (PushPredictorError, OSError) as error:
            self._abort(goal, one_line(error), error_code(error))
        except Exception as error:
            self._node.get_logger().error(traceback.format_exc())
            self._abort(goal, f"internal error, see the log of the node: {error!r}", ErrorCode.INTERNAL_ERROR)

    def _poll_validator(self, job: _Job) -> None:
        """Start on the validator's data once its folder is known. Raises RecordingError if there is none to trace."""
        try:
            folder = self._validator.poll()
        except RecordingError as error:
            raise RecordingError(f"output {job.output}: no data to trace, and {error}; give {EVIDENCE}") from None
        if folder is None:
            return
        if not (evidence := evidence_in(folder)):
            here = f"{folder}, the output of push_validator"
            raise RecordingError(f"output {job.output}: no data to trace, nor in {here}; give {EVIDENCE}")
        self._start(job, evidence)

    def _receive(self, job: _Job, pipe: Connection) -> None:
        try:
            received = pipe.recv()
        except (EOFError, OSError):
            self._abort(job.goal, _exit_reason(job.process), ErrorCode.INTERNAL_ERROR)
            return
        if isinstance(received, Stage):
            self._publish(received)
        elif isinstance(received, Failed):
            self._abort(job.goal, received.reason, received.code)
        elif isinstance(received, Traced):
            self._succeed(job, received)

    def _succeed(self, job: _Job, traced: Traced) -> None:
        assert job.folder is not None
        for name in RESULTS:
            if (job.folder / name).exists():
                (job.folder / name).replace(job.output / name)
        result = TraceResidual.Result(success=True, message=traced.message, verdict=traced.verdict)
        if traced.needs is not None:
            result.extended_model = str(job.output / EXTENDED)
            needs = ", ".join(traced.needs) or "no covariates"
            result.message += f" Load {result.extended_model} with load_model to use it; its requests need {needs}."
        self._node.get_logger().info(result.message)
        self._publish(Stage("done", 1.0))
        self._finish(job.goal, job.goal.succeed, result)

    def _publish(self, stage: Stage) -> None:
        assert self._job is not None
        self._job.stage = stage.name
        self._job.goal.publish_feedback(TraceResidual.Feedback(stage=stage.name, progress=stage.share))

    def _abort(self, goal: Any, reason: str, code: ErrorCode) -> None:
        self._node.get_logger().warning(f"trace_residual: {reason}")
        self._finish(goal, goal.abort, _result(reason, code))

    def _finish(self, goal: Any, end: Callable[[], None], result: TraceResidual.Result) -> None:
        if (job := self._job) is None or job.goal is not goal:
            self._action.finish(goal, end, result)
            return
        _clear(job)
        self._node.destroy_timer(self._timer)
        self._action.finish(goal, end, result)
        self._job = None  # last: from now on `close` waits for the result to be sent


def _result(message: str, code: ErrorCode) -> TraceResidual.Result:
    """The result of a goal without a verdict."""
    return TraceResidual.Result(success=False, message=message, error_code=int(code))


def _exit_reason(process: BaseProcess | None) -> str:
    """In words, how a process ended that sent no result."""
    assert process is not None
    process.join(5.0)
    code = process.exitcode
    how = f"signal {-code}" if code is not None and code < 0 else f"status {code}"
    return f"the process of the trace ended with {how} and no result, see the log of the node"


def _clear(job: _Job) -> None:
    """Kill the process and delete its work folder."""
    if job.process is not None:
        job.process.kill()
        job.process.join()
    if job.pipe is not None:
        job.pipe.close()
    if job.folder is not None:
        shutil.rmtree(job.folder, ignore_errors=True)
