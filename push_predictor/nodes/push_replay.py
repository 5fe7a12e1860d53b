"""Node push_replay: a recording as the sensors it was made with, on time, with a report of how well that went."""

from __future__ import annotations

import gc
import json
import os
import struct
import sys
import threading
import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.duration import Duration
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from push_predictor.errors import RigError
from push_predictor.nodes.qos import KEPT, LATCHED, read_overrides
from push_predictor.nodes.replay.controls import ReplayControls
from push_predictor.nodes.replay.options import ReplayOptions, read_options
from push_predictor.nodes.replay.topics import ReplayTopics, Restamper
from push_predictor.nodes.runtime import Stop, run
from push_predictor.recordings.bag.reader import Bag, RawMessage, open_bag
from push_predictor.recordings.rig import RECORD_NAME, load_rig, rig_from_record
from push_predictor.replay.back_pressure import Patience
from push_predictor.replay.clock import SECOND, PlayerClock, SystemWall, sharpen_sleep
from push_predictor.replay.player import Outlet, ReplayPlayer
from push_predictor.replay.source import BagSource
from push_predictor.replay.summary import ReplayReport
from push_predictor.resources import share_path

_PUSH_TOPICS = ("slider/pose", "pusher/pose", "pusher/wrench")


class PushReplay(Node):
    """Plays one recording. Raises PushPredictorError if a parameter or the recording is not accepted."""

    def __init__(self, stop: Stop) -> None:
        super().__init__("push_replay")
        self._stop = stop
        self._ending = threading.Event()
        self._options = options = read_options(self)
        bag = open_bag(options.recording)
        self._restamper = Restamper() if options.restamp else None
        self._topics = self._open_topics(bag)
        self._source = BagSource(bag, tuple(self._topics.senders))
        self._status = self.create_publisher(String, "replay_status", LATCHED)
        self._clock_publisher = self.create_publisher(Clock, "/clock", KEPT)
        self._rig = self.create_publisher(String, "rig", LATCHED)
        self._rig_warning = self._publish_rig(bag)
        self._acknowledged: bool | None = None
        self._player = self._make_player(options)
        self._controls = ReplayControls(self, self._player, restamps=options.restamp)
        self._start_reporting()
        self._threads = [threading.Thread(target=self._guarded, args=(work,)) for work in (self._play, self._tick)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop playing and say how it went."""
        self._ending.set()
        self._player.close()
        for thread in self._threads:
            thread.join()
        report = self._report()
        self._publish_report(report)
        if report.state != "finished":  # which has been reported
            self.get_logger().info(report.summary)

    def _open_topics(self, bag: Bag) -> ReplayTopics:
        chosen = {topic: kind for topic, kind in bag.topics.items() if self._options.filter.accepts(topic)}
        overrides = read_overrides(self._options.qos_overrides)
        topics = ReplayTopics(self, chosen, bag.qos, overrides, self._restamper, Patience(self._ending.is_set))
        for topic, why in topics.skipped.items():
            self.get_logger().warning(f"{topic} is not published: {why}")
        return topics

    def _publish_rig(self, bag: Bag) -> str:
        """Publish the push_rig record; answers what is wrong with it, if anything."""
        if self._options.rig is not None:
            record = load_rig(self._options.rig).to_record()
        else:
            record = {key: _text(value) for key, value in bag.metadata.get(RECORD_NAME, {}).items()}
            try:
                rig_from_record(record, str(bag.path))
            except RigError as error:
                self.get_logger().warning(f"topic rig stays silent: {error}")
                return str(error)
        self._rig.publish(String(data=json.dumps(record)))
        return ""

    def _make_player(self, options: ReplayOptions) -> ReplayPlayer:
        wall = SystemWall()
        clock = PlayerClock(wall, options.rate, options.start_paused, options.spin)
        outlet = Outlet(self._topics.make_room, self._publish, self._settle, self._announce)
        return ReplayPlayer(self._source, clock, wall, outlet, options.window, options.loop, options.delay)

    def _publish(self, message: RawMessage) -> bool:
        untimed = self._options.clock_frequency > 0.0 and message.topic in self._topics.untimed
        if self._options.clock_with_topics or untimed:
            self._publish_clock(message.log_time)
        return self._topics.send(message)

    def _settle(self) -> None:
        """Wait for acknowledgements, so that nobody hears `finished` before the last message."""
        timeout, begin = self._options.acked_timeout, time.perf_counter_ns()
        while timeout >= 0 and not self._ending.is_set():
            if self._topics.acknowledged():
                break
            if timeout and time.perf_counter_ns() - begin > timeout:
                break
            time.sleep(0.002)
        self._acknowledged = self._topics.acknowledged()

    def _announce(self, state: str) -> None:
        self._status.publish(String(data=state))
        if state == "finished":
            report = self._report()
            self._publish_report(report)
            self.get_logger().info(report.summary)
            if self._options.exit_when_finished:
                self._stop.request()

    def _play(self) -> None:
        sharpen_sleep()
        self._wait_for_subscribers()
        self._player.play(self._options.range)
        gc.collect()
        gc.freeze()  # what lives by now need not be looked at again while messages wait
        self._player.run()

    def _wait_for_subscribers(self) -> None:
        senders = self._topics.senders
        wanted = [s for topic, s in senders.items() if topic.strip("/") in _PUSH_TOPICS] or list(senders.values())
        deadline = time.perf_counter_ns() + self._options.wait_for_subscribers
        while time.perf_counter_ns() < deadline and not self._ending.is_set():
            if all(sender.publisher.get_subscription_count() for sender in wanted) and self._rig_is_known():
                return
            time.sleep(0.01)

    def _rig_is_known(self) -> bool:
        """Have those who want the rig got it? Samples that come before it would be judged by another one's."""
        matched = self._rig.get_subscription_count() >= self.count_subscribers(self._rig.topic_name)
        return matched and bool(self._rig.wait_for_all_acked(Duration(seconds=0)))

    def _tick(self) -> None:
        """Publish /clock at its frequency, of wall time: an executor's timer costs more and keeps its pace less."""
        frequency = self._options.clock_frequency
        period, begin, ticks = (1.0 / frequency if frequency else 0.0), time.perf_counter(), 0
        while frequency and not self._ending.wait(max(0.0, begin + ticks * period - time.perf_counter())):
            ticks = max(ticks + 1, int((time.perf_counter() - begin) / period))
            self._player.tell_time(self._publish_clock)

    def _publish_clock(self, recorded: int) -> None:
        if self._restamper is not None:
            self._restamper.settle(recorded)
            recorded += self._restamper.offset or 0
        self._clock_publisher.publish(b"\0\1\0\0" + struct.pack("<iI", *divmod(recorded, SECOND)))

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:  # a thread's death must not pass for a silent recording
            self._stop.fail(error)

    def _start_reporting(self) -> None:
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = RosClock(clock_type=ClockType.STEADY_TIME)  # a second of the wall, also where use_sim_time is set
        self.create_timer(1.0, lambda: self._publish_report(self._report()), clock=steady)

    def _report(self) -> ReplayReport:
        lateness = self._player.lateness
        return ReplayReport(
            recording=str(self._options.recording),
            state=self._player.state,
            rate=self._player.rate,
            published=self._player.published,
            late_p50=lateness.percentile(0.5) / 1000.0,
            late_p99=lateness.percentile(0.99) / 1000.0,
            late_max=lateness.maximum / 1000.0,
            behind=self._player.behind / SECOND,
            lost=self._player.failed + self._topics.overwritten,
            acknowledged=self._acknowledged,
            skipped=self._topics.skipped,
            unstamped=self._topics.unstamped,
            damage=self._source.damage,
            rig=self._rig_warning,
        )

    def _publish_report(self, report: ReplayReport) -> None:
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if report.warnings else DiagnosticStatus.OK,
            name=f"{self.get_fully_qualified_name().lstrip('/')}: replay",
            message="; ".join(report.warnings) or report.state,
            hardware_id=self._options.recording.name,
            values=[KeyValue(key=key, value=value) for key, value in report.values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = _stamp(time.time_ns())
        self._diagnostics.publish(message)


def main() -> int:
    """The executable."""
    # By default Fast DDS learns only every 3 s what a subscriber lacks; in that time a fast replay overwrites it.
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(share_path("config", "fastdds_replay.xml")))
    return run("push_replay", PushReplay)


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _stamp(nanoseconds: int) -> Time:
    seconds, rest = divmod(nanoseconds, SECOND)
    return Time(sec=seconds, nanosec=rest)


if __name__ == "__main__":
    sys.exit(main())
