# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The node push_recorder: writes the streams of a rig into an MCAP bag, and reports what is missing."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before the other imports: they take half a second, in which a signal may arrive
    from push_predictor.nodes import entry

    sys.exit(entry.push_recorder())

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.validate_topic_name import validate_topic_name

from msg_adapters.diagnostics import Level, diagnostic_array, diagnostic_status
from push_predictor.errors import RequestError
from push_predictor.nodes.parameter_tables import PUSH_RECORDER
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.recorder_subscriptions import RecorderSubscriptions
from push_predictor.nodes.rig_source import RigSource
from push_predictor.nodes.runtime import Stop, run
from push_predictor.online.live_recording import LiveRecording
from push_predictor.online.recorder_progress import LiveLine, Progress
from push_predictor.recordings.decoder.sources import resolved
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.topics import load_topics, topics_of

PERIOD = 0.02  # s between two looks at what has arrived
SHOWN = 1.0  # s between two updates of the line


class PushRecorder(Node):
    """Records until SIGINT, SIGTERM or the end of the duration. summary: of the recording, once it is closed.

    Raises PushPredictorError for a bad parameter, and later if the bag cannot be written.
    """

    def __init__(self, stop: Stop) -> None:
        super().__init__("push_recorder")
        self.summary: Progress | None = None
        declare(self, PUSH_RECORDER)
        values = values_of(self, PUSH_RECORDER)
        self._stop, self._duration = stop, values["duration"]
        self._recording = new_recording(self, values)
        self._rigs = RigSource(self, values["rig"])
        self._topics = RecorderSubscriptions(self, self._recording)
        self._line = LiveLine(self.get_logger().info, self.get_logger().warning)
        self._publisher = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # goes on while /clock stands still
        self.create_timer(PERIOD, self._work, clock=steady)
        self.create_timer(SHOWN, self._show, clock=steady)
        self.create_timer(values["diagnostics_period"], self._publish, clock=steady)

    def close(self) -> None:
        """Write what has arrived, and complete the bag. Raises RecordingError if it cannot be written."""
        self._line.clear()
        try:
            if self._stop.error is None:
                self._move()
        finally:
            self.summary = self._recording.close(monotonic())

    def _work(self) -> None:
        self._move()
        self._topics.look()
        if 0.0 < self._duration <= self._recording.seconds:
            self._stop.request()

    def _move(self) -> None:
        self._rigs.work()
        if self._rigs.rig is not None:
            self._recording.set_rig(self._rigs.rig)
        self._topics.drain()

    def _show(self) -> None:
        self._recording.work(monotonic())
        self._line.show(self._recording.progress(monotonic()), monotonic())

    def _publish(self) -> None:
        name, progress = self.get_fully_qualified_name(), self._recording.progress(monotonic())
        status = recorder_status(name, progress, self._rigs.rig)
        self._publisher.publish(diagnostic_array(self.get_clock().now().nanoseconds, status))


def new_recording(node: Node, values: Mapping[str, Any]) -> LiveRecording:
    """The recording that the parameters describe, with topics as they are named in the node's namespace.

    Raises RequestError that names the parameter, its value and what is accepted; RecordingError for an unreadable
    NAME.recording.yaml.
    """
    if not values["bag"]:
        raise RequestError("bag", "", "the path of a bag: a folder, or FILE.mcap")
    path = Path(values["bag"]).expanduser()
    if path.exists() and not values["force"]:
        raise RequestError("bag", str(path), "a path that does not exist, or force (option --force) to replace it")
    given = topics_of(values).over(load_topics(path))
    topics = resolved(given, lambda topic: _full_name(node, topic))
    return LiveRecording(path, topics, monotonic(), with_wrench=bool(given.wrench))


def _full_name(node: Node, topic: str) -> str:
    try:
        validate_topic_name(topic)
        return str(node.resolve_topic_name(topic))
    except InvalidTopicNameException as error:
        raise RequestError("topic", topic, f"a topic's name ({' '.join(str(error).split())})") from None


def record(args: Sequence[str] | None = None) -> tuple[int, Progress | None]:
    """Run the node until SIGINT or SIGTERM; returns the exit status, and the summary if a node was made."""
    made: list[PushRecorder] = []

    def make(stop: Stop) -> PushRecorder:
        made.append(PushRecorder(stop))
        return made[0]

    status = run("push_recorder", make, args)
    return status, made[0].summary if made else None


def main(args: Sequence[str] | None = None) -> int:
    """Run the node, and print the summary; returns the exit status."""
    status, summary = record(args)
    if summary is not None:
        print(summary.to_text())
    return status


def recorder_status(node_name: str, progress: Progress, rig: Rig | None) -> DiagnosticStatus:
    """WARN while something is missing. The message has the problems, the values the figures of every stream."""
    values: dict[str, object] = {"state": "recording" if progress.started else "waiting for messages"}
    values |= {"bag": progress.path, "seconds": progress.seconds, "messages": sum(progress.messages.values())}
    values |= {"windows": progress.windows, "pushes": progress.pushes, "share of contact": progress.contact}
    for each in progress.streams:
        values |= {f"{each.name} samples": each.samples, f"{each.name} rate": each.rate}
        values[f"{each.name} largest gap"] = each.largest_gap
    level = Level.WARN if progress.problems else Level.OK
    message = " ".join(progress.problems.values()) or str(values["state"])
    return diagnostic_status(node_name, "recording", level, message, values, rig.shape if rig else "")
