"""The action trace_residual: what a model leaves over in the pushes that were recorded, traced while predictions go on.

The trace runs in a process of its own (trace_worker); here its goal is taken, followed, cancelled and answered.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from time import monotonic
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from push_predictor.errors import PushPredictorError, RecordingError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import save_model
from push_predictor.nodes.runtime import one_line
from push_predictor.nodes.server.deferred_action import DeferredAction
from push_predictor.nodes.server.trace_worker import (
    EXTENDED,
    WRITTEN,
    Failed,
    Stage,
    Traced,
    TraceTask,
    evidence_in,
    start_trace,
)
from push_predictor.nodes.server.validator_folder import ValidatorFolder
from push_predictor_interfaces.action import TraceResidual

PERIOD = 0.05  # s between two looks at the process, while there is one
LAST_PATIENCE = 5.0  # s that the end of the node waits for its executor to end a trace and to send the result
HOLDS = "pushes.csv as push_validator writes it, push tables or recordings"


@dataclass(eq=False)
class _Job:
    """A goal at work: without a pipe a validator is being asked where it writes, with one a process traces."""

    goal: Any
    model: PushModel
    alpha: float
    output: Path
    place: Path | None = None
    process: BaseProcess | None = None
    pipe: Connection | None = None
    told: str = ""


class ResidualTracer:
    """One trace at a time. model_of: the model of a name, or raises PushPredictorError; alpha: the level at present.

    Everything but `close` happens in the executor's thread.
    """

    def __init__(self, node: Node, model_of: Callable[[str], PushModel], alpha: Callable[[], float]) -> None:
        self._node, self._model_of, self._alpha = node, model_of, alpha
        self._job: _Job | None = None
        self._timer: Any = None
        self._closing = threading.Event()
        self._validator = ValidatorFolder(node)
        self._action = DeferredAction(node, TraceResidual, "trace_residual", self._on_goal)

    def close(self) -> None:
        """End the trace that runs; for another thread than the executor's, which goes on meanwhile."""
        self._closing.set()
        if self._job is None:
            return
        deadline = monotonic() + LAST_PATIENCE
        while not self._all_told() and monotonic() < deadline:
            time.sleep(PERIOD)
        if (job := self._job) is not None:  # the executor has ended: nobody can be told any more
            _clear(job)

    def _all_told(self) -> bool:
        return self._job is None and self._action.told

    def end(self, reason: str) -> None:
        """End the trace that runs, if there is one; its client is told why."""
        if self._job is not None:
            self._abort(self._job.goal, reason)

    # --- a goal ---------------------------------------------------------------------------------------------

    def _on_goal(self, goal: Any) -> None:
        self._guarded(goal, lambda: self._begin(goal))

    def _begin(self, goal: Any) -> None:
        """Take the goal up. Raises PushPredictorError or OSError that says what is wrong with it."""
        if self._job is not None:
            running = f"{self._job.model.name} ({self._job.told})"
            raise RequestError("goal", "trace_residual", f"one at a time: {running} is being traced, wait or cancel it")
        request = goal.request
        model = self._model_of(request.model)
        if not request.output:
            raise RequestError("output", "", "the folder for report, verdict and extended model")
        output = Path(request.output).expanduser().absolute()
        self._job = job = _Job(goal, model, self._alpha(), output)
        self._timer = self._node.create_timer(PERIOD, self._work, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._tell(Stage("recorded pushes", 0.0))
        if evidence := evidence_in(output):
            self._trace(job, evidence)
        else:
            self._validator.ask()

    def _trace(self, job: _Job, evidence: tuple[Path, ...]) -> None:
        job.output.mkdir(parents=True, exist_ok=True)
        job.place = Path(tempfile.mkdtemp(prefix=".trace-", dir=job.output))
        model = job.place / "deployed.pushmodel"
        save_model(job.model, model)  # what is served, whatever has become of the file it was read from
        task = TraceTask(evidence, model, tuple(job.goal.request.covariates), job.alpha, job.place)
        job.process, job.pipe = start_trace(task)
        self._node.get_logger().info(f"tracing {job.model.name} on {', '.join(map(str, evidence))}")

    # --- what becomes of it ---------------------------------------------------------------------------------

    def _work(self) -> None:
        if (job := self._job) is None:
            return
        if job.goal.is_cancel_requested:
            self._finish(job.goal, job.goal.canceled, _result("cancelled: nothing was written"))
        elif self._closing.is_set():
            self._abort(job.goal, "the node ends: nothing was written")
        else:
            self._guarded(job.goal, lambda: self._follow(job))

    def _follow(self, job: _Job) -> None:
        if job.pipe is None:
            self._await_folder(job)
        while self._job is job and job.pipe is not None and job.pipe.poll():
            self._take(job, job.pipe)

    def _guarded(self, goal: Any, work: Callable[[], None]) -> None:
        """A callback that raises would end the node, so every failure becomes an answer."""
        try:
            work()
        except (PushPredictorError, OSError) as error:
            self._abort(goal, one_line(error))
        except Exception as error:
            self._node.get_logger().error(traceback.format_exc())
            self._abort(goal, f"internal error, see the log of the node: {error!r}")

    def _await_folder(self, job: _Job) -> None:
        """Go on where the validator writes, once it has said so. Raises RecordingError if there is nothing to trace."""
        try:
            folder = self._validator.work()
        except RecordingError as error:
            raise RecordingError(f"output {job.output}: holds nothing to trace, and {error}; give {HOLDS}") from None
        if folder is None:
            return
        if not (evidence := evidence_in(folder)):
            here = f"{folder}, the output of push_validator"
            raise RecordingError(f"output {job.output}: holds nothing to trace, nor does {here}; give {HOLDS}")
        self._trace(job, evidence)

    def _take(self, job: _Job, pipe: Connection) -> None:
        try:
            said = pipe.recv()
        except (EOFError, OSError):
            raise RecordingError(_death(job.process)) from None
        if isinstance(said, Stage):
            self._tell(said)
        elif isinstance(said, Failed):
            self._abort(job.goal, said.reason)
        elif isinstance(said, Traced):
            self._succeed(job, said)

    def _succeed(self, job: _Job, traced: Traced) -> None:
        assert job.place is not None
        for name in WRITTEN:
            if (job.place / name).exists():
                (job.place / name).replace(job.output / name)
        result = _result(traced.message)
        result.success, result.verdict = True, traced.verdict
        if traced.needs is not None:
            result.extended_model = str(job.output / EXTENDED)
            brings = ", ".join(traced.needs) or "nothing more"
            result.message += f" Offered to load_model: {result.extended_model}; a request must bring {brings}."
        self._node.get_logger().info(result.message)
        self._tell(Stage("done", 1.0))
        self._finish(job.goal, job.goal.succeed, result)

    def _tell(self, stage: Stage) -> None:
        assert self._job is not None
        self._job.told = stage.name
        self._job.goal.publish_feedback(TraceResidual.Feedback(stage=stage.name, progress=stage.share))

    def _abort(self, goal: Any, reason: str) -> None:
        self._node.get_logger().warning(f"trace_residual: {reason}")
        self._finish(goal, goal.abort, _result(reason))

    def _finish(self, goal: Any, end: Callable[[], None], result: TraceResidual.Result) -> None:
        if (job := self._job) is None or job.goal is not goal:
            self._action.finish(goal, end, result)
            return
        _clear(job)
        self._node.destroy_timer(self._timer)
        self._action.finish(goal, end, result)
        self._job = None  # last: `close` then waits until the result was sent


def _result(message: str) -> TraceResidual.Result:
    return TraceResidual.Result(success=False, message=message)


def _death(process: BaseProcess | None) -> str:
    """Why a process that said nothing more has ended."""
    assert process is not None
    process.join(5.0)
    code = process.exitcode
    how = f"signal {-code}" if code is not None and code < 0 else f"status {code}"
    return f"the process of the trace ended with {how} and told nothing, see the log of the node"


def _clear(job: _Job) -> None:
    """End the process and take away what it has laid down and nobody took."""
    if job.process is not None:
        job.process.kill()
        job.process.join()
    if job.pipe is not None:
        job.pipe.close()
    if job.place is not None:
        shutil.rmtree(job.place, ignore_errors=True)
