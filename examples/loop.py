# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop, step by step: an alarm, the trace of its cause, the extended model, the error before and after.

The validator's alarm reports that the model no longer fits. The action trace_residual finds the cause, and load_model
loads the extended model. A second validation compares both models on the pushes after the trace. In the demo the rig
changes during a replay; examples/hidden.py draws the change and hides it.
"""

from __future__ import annotations

import json
import shutil
import textwrap
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

from examples.hidden import Hidden
from examples.loop_picture import Story, draw_story, story_of
from examples.processes import node
from examples.stages import Page, Stages
from push_predictor.evaluation.validation import metrics_json
from push_predictor_interfaces.action import TraceResidual
from push_predictor_interfaces.msg import PushAlarm
from push_predictor_interfaces.srv import LoadModel

RATE, RATE_AGAIN = 40.0, 80.0
SHARES = (20.0, 19.0, 11.0, 25.0)  # s of the four stages on two idle cores
BEFORE, AFTER = "changed_online", "after_online"  # folders of the two validations
REPLAY_PATIENCE, TRACE_PATIENCE, PATIENCE = 200.0, 240.0, 30.0  # s


@dataclass(frozen=True)
class Traced:
    """The result of a trace: its message, its verdict, and the file of the extended model (None: no extension)."""

    message: str
    verdict: Mapping[str, Any]
    extended: Path | None


class TraceFailedError(SystemExit):
    """The server refused a trace, or could not finish it; the text is its reason."""


@dataclass(frozen=True)
class ClosedLoop:
    """What the loop did. alarm: None if it did not fire; traced: None if the trace failed, for the reason `failed`."""

    story: Story
    alarm: PushAlarm | None
    traced: Traced | None
    failed: str = ""


class Operator:
    """Receives the alarm, requests the trace, loads the model, as a person at the rig would. A context manager."""

    def __enter__(self) -> Operator:
        rclpy.init()
        self.alarm: PushAlarm | None = None
        self._node = Node("demo_operator")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._node.create_subscription(PushAlarm, "push_alarm", self._receive, latched)
        self._load = self._node.create_client(LoadModel, "load_model")
        self._trace = ActionClient(self._node, TraceResidual, "trace_residual")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        self._listens = True
        self._stage = ""
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._trace.destroy()
        self._node.destroy_node()
        rclpy.try_shutdown()

    def stop_listening(self) -> None:
        """Ignore later alarms."""
        self._listens = False

    def trace(self, model: str, output: Path) -> Traced:
        """Trace the residuals that a validator wrote into a folder. Raises TraceFailedError, SystemExit if it hangs."""
        if not self._trace.wait_for_server(PATIENCE):
            raise SystemExit(f"no action server trace_residual within {PATIENCE:.0f} s")
        goal = TraceResidual.Goal(model=model, output=str(output))
        sent = self._in_spin(lambda: self._trace.send_goal_async(goal, feedback_callback=self._progress))
        handle = _answer(sent, PATIENCE)
        result = _answer(self._in_spin(handle.get_result_async), TRACE_PATIENCE).result
        if not result.success:
            raise TraceFailedError(result.message)
        extended = Path(result.extended_model) if result.extended_model else None
        return Traced(result.message, json.loads(result.verdict), extended)

    def load(self, path: Path, name: str) -> str:
        """Load a model into the server, in addition to the others. Raises SystemExit if the server refuses it."""
        if not self._load.wait_for_service(PATIENCE):
            raise SystemExit(f"no service load_model within {PATIENCE:.0f} s")
        response = _answer(self._load.call_async(LoadModel.Request(path=str(path), name=name)), PATIENCE)
        if not response.success:
            raise SystemExit(f"load_model: {response.message}")
        return str(response.message)

    def _in_spin(self, request: Callable[[], Future]) -> Future:
        """Send a request in the thread that spins: from another one, rclpy's action client loses an early answer."""
        return cast(Future, _answer(self._executor.create_task(request), PATIENCE))

    def _receive(self, message: PushAlarm) -> None:
        if self._listens and self.alarm is None:
            self.alarm = message
            print(
                f"   ALARM after {message.pushes} pushes ({message.push_id}): the model no longer fits (evidence "
                f"{_odds(message.log10_evidence)}; false-alarm rate at most {100.0 * message.false_alarm_rate:g} %).",
                flush=True,
            )

    def _progress(self, message: Any) -> None:
        if message.feedback.stage != self._stage:
            self._stage = message.feedback.stage
            print(f"   {100.0 * message.feedback.progress:3.0f} % {self._stage}", flush=True)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return


def close_the_loop(model: Path, name: str, out: Path, hidden: Hidden, stages: Stages) -> list[Page]:
    """Run the loop, print its steps, and return the pages and pictures. Raises SystemExit if a node fails."""
    closed = run_loop(model, name, hidden.recorded, hidden.whole, out, stages=stages)
    if closed.traced is None:
        raise SystemExit(f"trace_residual: {closed.failed}")
    print_scores(closed.story)
    truth = json.loads(hidden.truth.read_text())  # not before
    revealed = ", ".join(f"{key} {value}".replace("_", " ") for key, value in truth.items() if key != "right names")
    print(f"   The hidden change was: {revealed} (the simulator's own parameter).")
    picture = draw_story(out / "loop.png", closed.story, closed.traced.verdict, truth)
    return [
        Page(out / BEFORE / "trace.html", "the traced cause: evidence, rivals, gain"),
        Page(picture, "the residual loop: alarm, trace, error before and after"),
    ]


def run_loop(
    model: Path,
    name: str,
    recorded: Path,
    whole: Path,
    out: Path,
    rates: tuple[float, float] = (RATE, RATE_AGAIN),
    stages: Stages | None = None,
) -> ClosedLoop:
    """Replay, watch for the alarm, trace, load the extended model, replay again; print what happens.

    recorded: the pushes before the trace; whole: those and later ones. rates: of the two replays. out: folder for what
    the validators write. stages: of which four begin here. Raises SystemExit if a node fails.
    """
    before, after = out / BEFORE, out / AFTER
    stages = stages or Stages(SHARES)
    with node("predict_server", {"models": [str(model)]}, "loop_server", out), Operator() as operator:
        stages.begin("Replay a second recording. After some pushes the rig changes. No node is informed of the change.")
        _replay(model, [], recorded, before, rates[0])
        time.sleep(1.0)  # the alarm may still be in transit
        operator.stop_listening()
        if operator.alarm is None:
            print("   The alarm did not fire. The trace is requested anyway.", flush=True)
        stages.begin("Trace the cause in the residuals that the validator recorded (action trace_residual).")
        traced, failed = _traced(operator, name, before)
        extended = None if traced is None else traced.extended
        served = None if extended is None else f"{name}_extended"
        stages.begin("Load the extended model (service load_model).")
        if extended is not None and served is not None:
            _print_lines(operator.load(extended, served))
        elif traced is not None:
            print("   There is no extended model: no effect was found that improves the log density.")
        # Replay from the beginning, so that time and push count are as before; only the pushes after the trace count.
        stages.begin("Continue the recording and compare both models on the pushes after the trace.")
        _replay(model, [served] if served else [], whole, after, rates[1])
    story = story_of(model, extended, served, before, after, operator.alarm)
    return ClosedLoop(story, operator.alarm, traced, failed)


def _traced(operator: Operator, name: str, folder: Path) -> tuple[Traced | None, str]:
    """The trace of a validator's folder, or None and the reason."""
    try:
        traced = operator.trace(name, folder)
    except TraceFailedError as error:
        _print_lines(f"The trace failed: {error}")
        return None, str(error)
    _print_lines(traced.message)
    return traced, ""


def _replay(model: Path, compare: list[str], recording: Path, output: Path, rate: float) -> None:
    """Replay a recording and validate it; return when the validator has written its result."""
    shutil.rmtree(output, ignore_errors=True)
    result = output / "validation.json"
    validator: dict[str, Any] = {"model": str(model), "output": str(output), "report": False}
    if compare:
        validator["compare"] = compare
    player = {"recording": str(recording), "play.rate": rate, "wait_for_subscribers": 30.0}
    with (
        node("push_validator", validator, f"{output.name}_validator", output.parent),
        node("push_replay", player, f"{output.name}_replay", output.parent),
    ):
        deadline = time.monotonic() + REPLAY_PATIENCE
        while not result.exists():
            if time.monotonic() > deadline:
                raise SystemExit(
                    f"the validator wrote no {result} within {REPLAY_PATIENCE:.0f} s: see {output.parent}/*.log"
                )
            time.sleep(0.1)


def print_scores(story: Story) -> None:
    """Print the error of both models on the pushes after the trace."""
    print(f"   Error on the {story.n_later} pushes after the trace (not used by the trace), with 95 % intervals:")
    for label, comparison in story.later.items():
        score: dict[str, Any] = metrics_json(comparison)
        spans = score["interval"]
        nmse, nlpd = (f"({spans[key]['low']:.2f} to {spans[key]['high']:.2f})" for key in ("nmse", "nlpd"))
        print(f"   {label:20s} NMSE {score['nmse']['total']:6.3f} {nmse}   NLPD {score['nlpd']['total']:7.2f} {nlpd}")


def _print_lines(text: str) -> None:
    print(textwrap.fill(text, 116, initial_indent="   ", subsequent_indent="   ", break_long_words=False), flush=True)


def _odds(log10_evidence: float) -> str:
    """Evidence as odds: 138 : 1, or 10^9 : 1 if it is larger than a million."""
    return f"{10.0**log10_evidence:.0f} : 1" if log10_evidence < 6.0 else f"10^{log10_evidence:.0f} : 1"


def _answer(future: Future, patience: float) -> Any:
    """The result of a future that the executor's thread completes. Raises SystemExit after `patience` seconds."""
    deadline = time.monotonic() + patience
    while not future.done():
        if time.monotonic() > deadline:
            raise SystemExit(f"no answer within {patience:.0f} s")
        time.sleep(0.02)
    return future.result()
