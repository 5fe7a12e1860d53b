# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The node push_recorder: writes the streams of a rig into an MCAP bag, and reports what is missing."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before the other imports: they take half a second, in which a signal may arrive
    from push_predictor.nodes import entry

    sys.exit(entry.push_recorder())

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from time import monotonic, time_ns
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from msg_adapters.diagnostics import diagnostic_array, diagnostic_status
from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.nodes.parameter_tables import PUSH_RECORDER
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.polling import ONE_TYPE, FollowingSubscription, check_sources
from push_predictor.nodes.qos import common_profile, message_class
from push_predictor.nodes.rig_source import RigSource
from push_predictor.nodes.runtime import Stop, run
from push_predictor.online.live_recording import LiveRecording
from push_predictor.online.recorder_progress import LiveLine, Progress
from push_predictor.recordings.bag.metadata import TopicInfo
from push_predictor.recordings.decoder.sources import resolved
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.topics import load_topics, topics_of

LOOK = 0.1  # s between two looks at the publishers
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


class RecorderSubscriptions:
    """Moves messages into a recording, with the time at which they arrived, or that of /clock with use_sim_time."""

    def __init__(self, node: Node, recording: LiveRecording) -> None:
        self._node, self._recording = node, recording
        names = [topic.name for topic in recording.wanted]
        self._topics = {name: FollowingSubscription(node, name, partial(self._unfit, name)) for name in names}
        self._looked = 0.0

    def look(self) -> None:
        """Subscribe to topics that have appeared. Call it often."""
        if monotonic() - self._looked < LOOK:
            return
        self._looked = monotonic()
        for name, reader in self._topics.items():
            self._recording.note(name, self._follow(name, reader))

    def drain(self) -> None:
        """Write the messages that have arrived since the last call, in order of arrival.

        Raises RecordingError if that fails.
        """
        if (now := self._simulated_time()) == 0:
            return  # the messages wait for the first time on /clock
        arrived: list[tuple[int, str, bytes, int]] = []
        for name, reader in self._topics.items():
            lost = reader.lost
            for message in reader.taken():
                arrived.append((now or message.received or time_ns(), name, message.message, reader.lost - lost))
                lost = reader.lost
        for at, topic, data, missing in sorted(arrived, key=lambda message: message[0]):
            self._recording.write(topic, at, data, missing)

    def _follow(self, name: str, reader: FollowingSubscription) -> str:
        """Subscribe to a topic as it is published now; returns why that is not possible, '' if it is."""
        reader.look()
        self._recording.set_published(name, bool(reader.offered))
        if reader.kind and not self._recording.type_of(name):
            self._recording.add_topic(_description(name, reader))
        if reader.problem == ONE_TYPE:
            return f"{name} has publishers of the types {' and '.join(reader.kinds)}. One type is accepted."
        return reader.problem

    def _unfit(self, name: str, kind: str) -> str:
        """Why messages of a type are not recorded, '' if they are."""
        known = self._recording.type_of(name)
        if known not in ("", kind):
            return f"{name} is now of type {kind}. Only its first type, {known}, is recorded."
        try:
            message_class(kind)
        except PushPredictorError as error:
            return f"{name} is not recorded: {error}."
        return ""

    def _simulated_time(self) -> int | None:
        """The time on /clock in ns, 0 before the first, None without use_sim_time."""
        clock = self._node.get_clock()
        simulated = clock.clock_type == ClockType.ROS_TIME and clock.ros_time_is_active
        return int(clock.now().nanoseconds) if simulated else None


def _description(name: str, reader: FollowingSubscription) -> TopicInfo:
    publishers = [publisher for publisher in reader.offered if publisher.topic_type == reader.kind]
    profile = common_profile([publisher.qos_profile for publisher in publishers])
    return TopicInfo(
        name,
        reader.kind,
        0,
        str(publishers[0].topic_type_hash),
        durability="transient_local" if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL else "volatile",
        reliability="reliable" if profile.reliability == ReliabilityPolicy.RELIABLE else "best_effort",
    )


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
    check_sources(given)
    topics = resolved(given, node.resolve_topic_name)
    return LiveRecording(path, topics, monotonic(), with_wrench=bool(given.wrench))


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
    level = DiagnosticStatus.WARN if progress.problems else DiagnosticStatus.OK
    message = " ".join(progress.problems.values()) or str(values["state"])
    return diagnostic_status(node_name, "recording", level, message, values, rig.shape if rig else "")
