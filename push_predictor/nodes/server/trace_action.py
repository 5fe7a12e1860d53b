# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The action trace_residual: explain what a model fails to predict in recorded pushes, while predictions go on.

The trace runs in a process of its own (online.trace_process), which a thread of the executor watches.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.node import Node

from push_predictor.error_codes import ErrorCode
from push_predictor.errors import RecordingError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import save_model
from push_predictor.nodes.server.guarded_action import GuardedAction
from push_predictor.online.child_process import Child
from push_predictor.online.trace_process import (
    EXTENDED,
    RESULTS,
    Failed,
    Stage,
    Traced,
    TraceTask,
    evidence_in,
    run_trace,
)
from push_predictor_interfaces.action import TraceResidual

POLL_PERIOD = 0.05  # s between two looks at whether the goal is still wanted
EVIDENCE = "pushes.csv as push_validator writes it, push tables or recordings"


class TraceAction:
    """The action. model_of: the model of a name, or raises PushPredictorError; alpha: the present level.

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
        self._log, self._model_of, self._alpha = node.get_logger(), model_of, alpha
        self.action = GuardedAction(node, TraceResidual, "trace_residual", self._trace, may_begin, may_continue)

    def _trace(self, goal: Any, check: Callable[[], None]) -> TraceResidual.Result:
        """Trace the pushes of a goal. Raises PushPredictorError or OSError that states what is wrong with it."""
        request = goal.request
        model = self._model_of(request.model)
        self.action.doing = f"the trace of {model.name}"
        if not request.output:
            raise RequestError("output", "", "the folder for report, verdict and extended model")
        output = Path(request.output).expanduser().absolute()
        evidence = _evidence("data" if request.data else "output", request.data or request.output)
        _publish(goal, Stage("recorded pushes", 0.0))
        output.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".trace-", dir=output, ignore_cleanup_errors=True) as work:
            folder = Path(work)
            deployed = folder / "deployed.pushmodel"
            save_model(model, deployed)  # the model in use; its original file may have changed since
            self._log.info(f"tracing {model.name} on {', '.join(map(str, evidence))}")
            task = TraceTask(evidence, deployed, tuple(request.covariates), self._alpha(), folder)
            ended = _watched(goal, check, task)
            if isinstance(ended, Failed):
                return TraceResidual.Result(success=False, message=ended.reason, error_code=int(ended.code))
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


def _watched(goal: Any, check: Callable[[], None], task: TraceTask) -> Traced | Failed:
    """The last message of the process; its stages become feedback. Raises what `check` raises, after its end."""
    child = Child("trace", run_trace)
    child.start(task)
    try:
        while True:
            check()
            try:
                received: Stage | Traced | Failed | None = child.received(POLL_PERIOD)
            except (EOFError, OSError):
                return Failed(_exit_reason(child.status(5.0)), ErrorCode.INTERNAL_ERROR)
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


def _exit_reason(status: int) -> str:
    """In words, how a process ended that sent no result."""
    how = f"signal {-status}" if status < 0 else f"status {status}"
    return f"the process of the trace ended with {how} and no result, see the log of the node"
