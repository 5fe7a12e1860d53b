"""The residual loop on screen: an alarm, its cause traced, the extended model served, the error before and after.

A replay changes on the way; by what, is not known here (examples/hidden.py). The validator's alarm says that the model
no longer fits, the action trace_residual says what the model lacks, load_model puts the extended model into service,
and a validator asks both models about the same later pushes.
"""

from __future__ import annotations

import json
import shutil
import textwrap
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

from examples.hidden import make_hidden
from examples.loop_picture import Story, draw_story, story_of
from examples.processes import node
from push_predictor.evaluation.validation import metrics_json
from push_predictor_interfaces.action import TraceResidual
from push_predictor_interfaces.msg import PushAlarm
from push_predictor_interfaces.srv import LoadModel

RATE, RATE_AGAIN = 10.0, 20.0
REPLAY_PATIENCE, TRACE_PATIENCE, PATIENCE = 200.0, 240.0, 30.0  # s


@dataclass(frozen=True)
class Traced:
    """What came of a trace: message and verdict of the action, the extended model's file (None: there is none)."""

    message: str
    verdict: Mapping[str, Any]
    extended: Path | None


class Operator:
    """Hears the alarm, asks for the trace, loads the model: what a person at the rig would do. A context manager."""

    def __enter__(self) -> Operator:
        rclpy.init()
        self.alarm: PushAlarm | None = None
        self._node = Node("demo_operator")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._node.create_subscription(PushAlarm, "push_alarm", self._hear, latched)
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
        """Later alarms are of no interest."""
        self._listens = False

    def trace(self, model: str, output: Path) -> Traced:
        """Have what was recorded in a folder traced. Raises SystemExit if the server does not do it."""
        if not self._trace.wait_for_server(PATIENCE):
            raise SystemExit("trace_residual is not offered")
        goal = TraceResidual.Goal(model=model, output=str(output))
        handle = _answer(self._trace.send_goal_async(goal, feedback_callback=self._progress), PATIENCE)
        result = _answer(handle.get_result_async(), TRACE_PATIENCE).result
        if not result.success:
            raise SystemExit(f"trace_residual: {result.message}")
        extended = Path(result.extended_model) if result.extended_model else None
        return Traced(result.message, json.loads(result.verdict), extended)

    def load(self, path: Path, name: str) -> str:
        """Have a model served beside the others. Raises SystemExit if it is refused."""
        if not self._load.wait_for_service(PATIENCE):
            raise SystemExit("load_model is not offered")
        response = _answer(self._load.call_async(LoadModel.Request(path=str(path), name=name)), PATIENCE)
        if not response.success:
            raise SystemExit(f"load_model: {response.message}")
        return str(response.message)

    def _hear(self, message: PushAlarm) -> None:
        if self._listens and self.alarm is None:
            self.alarm = message
            print(
                f"   ALARM on push_alarm: push {message.push_id}, the {message.pushes}th, evidence 10^"
                f"{message.log10_evidence:.1f} (false with a probability of at most {message.false_alarm_rate:g})",
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


def close_the_loop(model: Path, name: str, out: Path, seed: int) -> Path:
    """Run it, tell it, and answer where the picture is. Raises SystemExit if a node fails."""
    print("4. a second replay, at first like the training; then something changes, nobody says what", flush=True)
    hidden = make_hidden(out, seed)
    before, after = out / "changed_online", out / "after_online"
    with node("predict_server", {"models": [str(model)]}, "loop_server"), Operator() as operator:
        _replay(model, [], hidden.recorded, before, RATE)
        time.sleep(1.0)  # the alarm may be on its way
        operator.stop_listening()
        if operator.alarm is None:
            print("   the alarm did not fire; the trace is asked for all the same")
        print("5. trace_residual on what was recorded")
        traced = operator.trace(name, before)
        _print_lines(traced.message)
        print("6. load the extended model, and go on")
        served = None if traced.extended is None else f"{name}_extended"
        if traced.extended is None or served is None:
            print("   there is none: the trace did not find enough to change the model; it goes on as it is")
        else:
            _print_lines(operator.load(traced.extended, served))
        # From the beginning: what counts pushes or time counts as before. Judged are the pushes after the trace only.
        _replay(model, [served] if served else [], hidden.whole, after, RATE_AGAIN)
    story = story_of(model, traced.extended, served, before, after, operator.alarm)
    _print_scores(story)
    truth = json.loads(hidden.truth.read_text())  # not before
    told = ", ".join(f"{key} {value}" for key, value in truth.items() if key != "right names")
    print(f"   what had been hidden: {told}")
    return draw_story(out / "loop.png", story, traced.verdict, truth)


def _replay(model: Path, compare: list[str], recording: Path, output: Path, rate: float) -> None:
    """Replay a recording before a validator until its result is written."""
    shutil.rmtree(output, ignore_errors=True)
    result = output / "validation.json"
    validator: dict[str, Any] = {"model": str(model), "output": str(output), "report": False}
    if compare:
        validator["compare"] = compare
    player = {"recording": str(recording), "play.rate": rate, "wait_for_subscribers": 30.0}
    with (
        node("push_validator", validator, f"{output.name}_validator"),
        node("push_replay", player, f"{output.name}_replay"),
    ):
        deadline = time.monotonic() + REPLAY_PATIENCE
        while not result.exists():
            if time.monotonic() > deadline:
                raise SystemExit(f"{result} was not written within {REPLAY_PATIENCE:.0f} s; see {output.parent}/*.log")
            time.sleep(0.1)


def _print_scores(story: Story) -> None:
    print(f"   the {story.n_later} pushes after the trace, which it never saw, by both models:")
    for label, comparison in story.later.items():
        score: dict[str, Any] = metrics_json(comparison)
        spans = score["interval"]
        nmse, nlpd = (f"({spans[key]['low']:.2f} to {spans[key]['high']:.2f})" for key in ("nmse", "nlpd"))
        print(f"   {label:20s} NMSE {score['nmse']['total']:6.3f} {nmse}   NLPD {score['nlpd']['total']:7.2f} {nlpd}")


def _print_lines(text: str) -> None:
    print(textwrap.fill(text, 116, initial_indent="   ", subsequent_indent="   ", break_long_words=False), flush=True)


def _answer(future: Future, patience: float) -> Any:
    """What a future holds, once it does; the executor's thread works on it."""
    deadline = time.monotonic() + patience
    while not future.done():
        if time.monotonic() > deadline:
            raise SystemExit(f"no answer within {patience:.0f} s")
        time.sleep(0.02)
    return future.result()
