# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The node push_replay: publishes a recording on time in place of the sensors, and reports how late it was."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before the other imports: they take half a second, in which a signal may arrive
    from push_predictor.nodes import entry

    sys.exit(entry.push_replay())

import os
import struct
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock

from msg_adapters.diagnostics import diagnostic_array, diagnostic_status, level_of
from msg_adapters.rigs import rig_to_message
from push_predictor.errors import RecordingError, RequestError, RigError
from push_predictor.nodes.parameter_tables import PUSH_REPLAY
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.qos import CLOCK, KEPT, LATCHED
from push_predictor.nodes.replay_controls import ReplayControls
from push_predictor.nodes.replay_topics import ReplayTopics, check_filter, is_played, listed
from push_predictor.nodes.runtime import Stop, run
from push_predictor.online.check_process import CheckProcess
from push_predictor.recordings.bag.messages import Notes, RawMessage
from push_predictor.recordings.bag.reader import Bag, open_bag
from push_predictor.recordings.decoder.sources import TF
from push_predictor.recordings.rig import RECORD_NAME, load_rig, rig_from_record
from push_predictor.recordings.topics import Topics, load_topics, topics_of
from push_predictor.recordings.untyped_topics import tell_types
from push_predictor.replay.player import SECOND, PlayerOutput, PlayRange, ReplayPlayer
from push_predictor.replay.report import ReplayReport
from push_predictor.replay.source import BagSource, missing_poses, push_topics
from push_predictor.resources import share_path
from push_predictor_interfaces.msg import PushRig, ReplayStatus

STATES = {"playing": ReplayStatus.PLAYING, "paused": ReplayStatus.PAUSED, "finished": ReplayStatus.FINISHED}
RANGE = ("start_offset", "playback_duration", "playback_until_timestamp")
LARGEST_CHECKED = 300_000_000  # bytes: a check reads the whole recording into memory


class PushReplay(Node):
    """Plays one recording. Raises PushPredictorError for a parameter or a recording that is not accepted.

    threads: of its executor: ~/burst waits for subscribers while the other controls work.
    """

    threads = 3

    def __init__(self, stop: Stop) -> None:
        super().__init__("push_replay")
        self._stop = stop
        self._ending = threading.Event()
        declare(self, PUSH_REPLAY)
        self._values = values = values_of(self, PUSH_REPLAY)
        if not values["recording"]:
            raise RequestError("recording", "", "the path of a recording (docs/reference/recordings.md)")
        check_filter(values)
        self._recording, self._given_topics = Path(values["recording"]).expanduser(), topics_of(values)
        self._given_rig = load_rig(Path(values["rig"]).expanduser()) if values["rig"] else None
        bag = open_bag(self._recording)
        self._streams = self._stream_topics()
        self._topics = self._open_topics(bag)
        self._source = BagSource(bag, tuple(self._topics.publishers))
        self._status = self.create_publisher(ReplayStatus, "replay_status", LATCHED)
        self._clock_publisher = self._open_clock()
        self._rig = self.create_publisher(PushRig, "rig", LATCHED)
        self._rig_warning = self._publish_rig(bag)
        self._acknowledged: bool | None = None
        self._checks = CheckProcess(values["strict"])
        self._player = self._make_player()
        self._check(bag)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = RosClock(clock_type=ClockType.STEADY_TIME)  # wall time, even with use_sim_time
        self.create_timer(1.0, self._report_regularly, clock=steady)
        ReplayControls(self, self._player)
        self._threads = [threading.Thread(target=self._guarded, args=(w,)) for w in (self._play, self._publish_time)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop the playback and publish the last report."""
        self._ending.set()
        self._player.close()
        self._checks.stop()
        for thread in self._threads:
            thread.join()
        report = self._report()
        self._publish_report(report)
        if report.state != "finished":  # that state has been reported
            self.get_logger().info(report.summary)

    def _open_topics(self, bag: Bag) -> ReplayTopics:
        notes = Notes()
        try:
            tell_types(bag, self._streams, (TF,), notes)
        except RecordingError as error:  # of a pose, which is not played then
            notes.add(str(error))
        for note in notes:
            self.get_logger().warning(note)
        chosen = {topic: kind for topic, kind in bag.topics.items() if is_played(topic, self._values) and kind}
        topics = ReplayTopics(self, chosen, bag.qos, self._ending.is_set)
        for topic, why in topics.skipped.items():
            self.get_logger().warning(f"{topic} is not published: {why}")
        return topics

    def _open_clock(self) -> Publisher | None:
        """The publisher of /clock, only if it will be published, as by rosbag2."""
        asked = [self._values[f"play.clock_publish_{when}"] for when in ("frequency", "on_topic_publish")]
        if not any(asked) and not self._topics.untimed:
            return None
        return self.create_publisher(Clock, "/clock", KEPT if self._topics.untimed else CLOCK)

    def _publish_rig(self, bag: Bag) -> str:
        """Publish the given rig, or the recorded one; returns what is wrong with that, empty if nothing."""
        try:
            rig = self._given_rig or rig_from_record(bag.metadata.get(RECORD_NAME, {}), str(bag.path))
        except RigError as error:
            self.get_logger().warning(f"the topic rig is not published: {error}")
            return str(error)
        self._rig.publish(rig_to_message(rig))
        return ""

    def _stream_topics(self) -> Topics:
        """The topics of slider, pusher and wrench: given, or saved next to the recording; the others are not named."""
        try:
            return self._given_topics.over(load_topics(self._recording))
        except RecordingError as error:  # of NAME.recording.yaml, which playing does not need
            self.get_logger().warning(str(error))
            return self._given_topics

    def _check(self, bag: Bag) -> None:
        """Begin the check of the recording, in a process of its own; one without a rig or poses is not checked."""
        missing = missing_poses(bag.topics, self._streams)
        if self._rig_warning:
            self._checks.skip("no rig")
        elif missing:
            self._checks.skip(f"no topic {' or '.join(missing)}")
            if self._streams != Topics():
                self.get_logger().warning(f"the recording is {self._checks.result}")
        elif (size := _size(bag.path)) > LARGEST_CHECKED:
            self._checks.skip(f"{size / 1e6:.0f} MB. Run `push_predictor check`.")
        else:
            self._checks.start(self._recording, self._given_rig, self._given_topics)

    def _report_regularly(self) -> None:
        checked = not self._checks.busy
        self._checks.work()
        if not checked and not self._checks.busy:
            failure = [f"the recording is {self._checks.result}"] if self._checks.failure else []
            for problem in failure or self._checks.problems:
                self.get_logger().warning(problem)
        self._publish_report(self._report())

    def _make_player(self) -> ReplayPlayer:
        names = {"window": "read_ahead_queue_size", "rate": "rate", "paused": "start_paused", "loop": "loop"}
        options = {option: self._values[f"play.{name}"] for option, name in names.items()}
        output = PlayerOutput(self._prepare, self._settle, self._announce)
        return ReplayPlayer(self._source, output, delay=_ns(self._values["play.delay"]), **options)

    def _prepare(self, message: RawMessage) -> Callable[[], bool]:
        self._topics.make_room(message.topic)
        triggers = self._values["play.clock_trigger_topics"]  # empty for all
        with_clock = self._values["play.clock_publish_on_topic_publish"]
        if message.topic in self._topics.untimed or (with_clock and (not triggers or listed(message.topic, triggers))):
            return partial(self._publish_with_clock, message)
        return partial(self._topics.publish, message)

    def _publish_with_clock(self, message: RawMessage) -> bool:
        self._publish_clock(message.log_time)
        return self._topics.publish(message)

    def _settle(self) -> None:
        """Wait for acknowledgements, so that no subscriber receives `finished` before the last message."""
        timeout, begin = _ns(self._values["play.wait_acked_timeout"]), time.perf_counter_ns()
        while timeout >= 0 and not self._ending.is_set():
            if self._topics.acknowledged():
                break
            if timeout and time.perf_counter_ns() - begin > timeout:
                break
            self._ending.wait(0.01)
        self._acknowledged = self._topics.acknowledged()

    def _announce(self, state: str) -> None:
        self._status.publish(ReplayStatus(state=STATES[state]))
        if state == "finished":
            report = self._report()
            self._publish_report(report)
            self.get_logger().info(report.summary)
            if self._values["exit_when_finished"]:
                self._stop.request()

    def _play(self) -> None:
        self._wait_for_subscribers()
        offset, *ends = (_ns(self._values[f"play.{name}"]) for name in RANGE)
        duration, until = (None if end < 0 else end for end in ends)
        self._player.play(PlayRange(offset, duration, until))
        self._player.run()

    def _wait_for_subscribers(self) -> None:
        publishers = self._topics.publishers
        needed = push_topics(publishers, self._streams)
        wanted = [each for topic, each in publishers.items() if topic in needed] or list(publishers.values())
        deadline = time.perf_counter_ns() + _ns(self._values["wait_for_subscribers"])
        while time.perf_counter_ns() < deadline and not self._ending.is_set():
            if all(each.get_subscription_count() for each in wanted) and self._rig_received():
                return
            time.sleep(0.01)

    def _rig_received(self) -> bool:
        """Whether all subscribers of the rig have received it; samples must not come before their rig."""
        matched = self._rig.get_subscription_count() >= self.count_subscribers(self._rig.topic_name)
        return matched and bool(self._rig.wait_for_all_acked(Duration(seconds=0)))

    def _publish_time(self) -> None:
        """Publish /clock at its frequency; an executor's timer would cost more and be less regular."""
        frequency = self._values["play.clock_publish_frequency"]
        period, begin, ticks = (1.0 / frequency if frequency else 0.0), time.perf_counter(), 0
        while frequency and not self._ending.wait(max(0.0, begin + ticks * period - time.perf_counter())):
            ticks = max(ticks + 1, int((time.perf_counter() - begin) / period))
            self._player.report_time(self._publish_clock)

    def _publish_clock(self, recorded: int) -> None:
        if self._clock_publisher is not None:
            self._clock_publisher.publish(b"\0\1\0\0" + struct.pack("<iI", *divmod(recorded, SECOND)))

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:  # a dead thread must not look like a recording without messages
            self._stop.fail(error)

    def _report(self) -> ReplayReport:
        return ReplayReport(
            recording=str(self._recording),
            state=self._player.state,
            rate=self._player.rate,
            published=self._player.published,
            late=self._player.lateness.delays(),
            behind=self._player.behind / SECOND,
            lost=self._player.failed + self._topics.overwritten,
            acknowledged=self._acknowledged,
            skipped=self._topics.skipped,
            damage=self._source.damage,
            rig=self._rig_warning,
            problems=self._checks.problems,
            check=self._checks.result,
        )

    def _publish_report(self, report: ReplayReport) -> None:
        level = level_of(self._checks.failed, report.warnings)
        message = "; ".join(report.warnings) or report.state
        name, recording = self.get_fully_qualified_name(), self._recording.name
        status = diagnostic_status(name, "replay", level, message, report.values, recording)
        self._diagnostics.publish(diagnostic_array(time.time_ns(), status))


def main() -> int:
    """Run the node until SIGINT or SIGTERM; returns the exit status."""
    # By default Fast DDS asks subscribers only every 3 s what they lack; a fast replay overwrites it in that time.
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(share_path("config", "fastdds_replay.xml")))
    return run("push_replay", PushReplay)


def _size(path: Path) -> int:
    """Bytes of a recording."""
    return sum(file.stat().st_size for file in (path.iterdir() if path.is_dir() else [path]))


def _ns(seconds: float) -> int:
    return round(seconds * SECOND)
