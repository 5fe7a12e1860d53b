# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The subscriptions to tracker, robot, force sensor and scalars; their samples are taken in portions."""

from __future__ import annotations

import threading
from dataclasses import replace
from time import monotonic
from typing import TypeAlias

from rclpy.node import Node

from push_predictor.nodes.polling import check_sources
from push_predictor.nodes.validator.live_streams import FrameStream, TopicStream, TransformTopics
from push_predictor.nodes.validator.scalar_topics import ClockTopic, ScalarTopic
from push_predictor.online.stream_health import TopicReport
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder, key_of
from push_predictor.recordings.decoder.poses import PoseFrame
from push_predictor.recordings.decoder.sources import STREAMS
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.decoder.wrench import UNKNOWN_BIAS
from push_predictor.recordings.fields.transforms import WORLD
from push_predictor.recordings.streams import ScalarStream
from push_predictor.recordings.topics import TIP_AXES, WORLD_AXES, Topics

PERIOD = 0.01  # s between two looks into the middleware, which keeps the last messages only
LOOK = 0.05  # s between two looks at the publishers
PATIENCE = 1.0  # s that a run waits for the first message of every topic

Stream: TypeAlias = FrameStream | TopicStream


class SensorSubscriber:
    """Subscribes to slider, pusher, wrench and scalars as the topics state, and decodes what arrives.

    Headers must name the frame `world` where no other is given. A thread empties the middleware's queues: a fast replay
    fills them while a portion of samples is processed. Raises RequestError for a source that is not valid.
    """

    def __init__(self, node: Node, topics: Topics) -> None:
        check_sources(topics)
        self._error = node.get_logger().error
        self.decoder = decoder = StreamDecoder(topics, expected=WORLD)
        self._tf = {name: TransformTopics(node, f"/{name}", buffer) for name, buffer in decoder.tf.items()}
        sensors: list[Stream] = [
            FrameStream(node, name, pose, self._tf[key_of(pose.source.topic)])
            if isinstance(pose, PoseFrame)
            else TopicStream(node, name, pose.messages)
            for name, pose in decoder.poses.items()
        ]
        sensors.append(TopicStream(node, "wrench", decoder.wrench.messages))
        clock = ClockTopic(node)
        self._scalars = [ScalarTopic(node, name, own, clock.history) for name, own in decoder.scalars.items()]
        self._streams = [*sensors, *self._scalars]
        self._subscribed: list[TopicStream | TransformTopics | ClockTopic] = [*self._scalars]
        self._subscribed += [stream for stream in sensors if isinstance(stream, TopicStream)]
        self._subscribed += [*self._tf.values(), *([clock] if self._scalars else [])]
        self._reports: dict[Stream, TopicReport] = {}
        self._empty = monotonic()  # when nothing waited last
        framed = any(isinstance(pose, PoseFrame) for pose in decoder.poses.values())
        self._settled = bool(topics.world) or not framed  # whether the frame of poses is known from the first message
        self._looked = -LOOK
        self._draining, self._ending = threading.Lock(), threading.Event()
        self.look()
        self._thread = threading.Thread(target=self._drain_repeatedly, name="sensor subscriber", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ending.set()
        self._thread.join()

    def __len__(self) -> int:
        return len(self.decoder)

    def complete(self) -> bool:
        """Whether messages of every topic wait, or messages of some topic have waited for PATIENCE.

        Call it often: it measures the time since no message waited. Frames of tf always wait for PATIENCE, unless the
        world is given: only a whole tree has the right root.
        """
        waiting = [len(each) > 0 for each in (*self.decoder.poses.values(), self.decoder.wrench.messages)]
        if not any(waiting):
            self._empty = monotonic()
        scalars = all(len(scalar) for scalar in self._scalars if scalar.own.kind)
        early = all(waiting) and scalars and self._settled
        return early or monotonic() - self._empty > PATIENCE

    @property
    def world(self) -> str:
        """The frame in which the poses are."""
        return self.decoder.world or WORLD

    def look(self) -> None:
        """Subscribe as the present publishers offer their topics; call often, in the executor's thread."""
        if monotonic() - self._looked < LOOK:
            return
        self._looked = monotonic()
        with self._draining:
            for subscribed in self._subscribed:
                subscribed.move()
                subscribed.look()

    def drain(self) -> None:
        """Move arrived messages from the middleware into the decoder."""
        with self._draining:  # one at a time, so that messages stay in order
            for subscribed in self._subscribed:
                subscribed.move()

    def _drain_repeatedly(self) -> None:
        while not self._ending.wait(PERIOD):
            try:
                self.drain()
            except Exception as error:  # without this thread the queues would overflow
                self._error(f"messages could not be taken: {error!r}", throttle_duration_sec=10.0)

    @property
    def waits_for_bias(self) -> bool:
        """Whether the wrench is held back because its bias is not known yet."""
        return self.decoder.wrench.waits_for_bias

    def take(self) -> Samples:
        """The usable samples since the last call."""
        self._empty = monotonic()
        with self._draining:
            for scalar in self._scalars:
                scalar.date()
        return self.decoder.take()

    def last_scalars(self) -> dict[str, ScalarStream]:
        """The scalars since the last sample of a sensor."""
        with self._draining:
            for scalar in self._scalars:
                scalar.date(last=True)
        return self.decoder.take_scalars(last=True)

    def inspect(self) -> list[TopicReport]:
        """Make the reports about the topics anew."""
        with self._draining:
            self._reports = {stream: self._amended(stream.report()) for stream in self._streams}
        return [*self._reports.values()]

    def _amended(self, report: TopicReport) -> TopicReport:
        """That about the wrench with what is wrong with its frame in tf; as it is without a publisher."""
        frame, problem = self.decoder.wrench.frame, self.decoder.wrench.problem
        if report.stream != "wrench" or not frame or report.problem or report.note:
            return report
        tf = next(iter(self._tf.values()))
        if tf.problem:
            return replace(report, problem=f"tf: {tf.problem}", refused=bool(tf.refusal))
        if problem:
            accepted = f"{problem}; {TIP_AXES} and {WORLD_AXES} are accepted as well"
            return replace(report, problem=f"wrench_frame {frame!r}: {accepted}.")
        return replace(report, note=f"Its axes are turned from {frame!r} by tf.")

    @property
    def refused(self) -> bool:
        """Whether a topic cannot be used as it is, by the last inspection."""
        return any(report.refused for report in self._reports.values())

    def figures(self) -> dict[str, object]:
        """The report about each topic, counts of its messages, and of rejected ones by the kinds that occurred."""
        found: dict[str, object] = {}
        for stream, report in self._reports.items():
            name, own = report.stream, stream.own
            found |= {f"{name} topic": report.line, f"{name} samples": own.received}
            found |= {f"{name} rejected": own.rejected.total()}
            found |= {f"{name} rejected {kind}": count for kind, count in own.rejected.items()}
            found |= {f"{name} {what}": n for what, n in (("dropped", own.dropped), ("lost", stream.lost)) if n}
        return found | self._wrench_figures()

    def _wrench_figures(self) -> dict[str, object]:
        wrench = self.decoder.wrench
        found: dict[str, object] = {"wrench without pose": wrench.without_pose} if wrench.without_pose else {}
        if wrench.bias is not None:
            pending = f"not known yet: {wrench.bias.problem or 'too few samples'}"
            found["wrench bias"] = pending if wrench.estimate is None else wrench.estimate.to_text()
        return found

    def problems(self) -> list[str]:
        """What keeps pushes from being found, in words; about the topics by the last inspection."""
        found = []
        for stream, report in self._reports.items():
            name, own, topic = report.stream, stream.own, report.topic
            if report.problem:
                found.append(f"{topic}: {report.problem}")
            if own.rejected:
                kinds = ", ".join(f"{kind} {count}" for kind, count in own.rejected.items())
                found.append(f"{topic}: {own.rejected.total()} of {own.received} samples were rejected ({kinds}).")
            if name in STREAMS and isinstance(own, TopicInput) and (problem := self.decoder.problem(name)):
                found.append(f"{topic}: {problem}.")
            if stream.lost:
                found.append(f"{topic}: {stream.lost} samples were lost. Replay slower, or use a deeper queue (QoS).")
            if own.dropped:
                found.append(f"{topic}: {own.dropped} samples were dropped before they could be used.")
        return found + self._wrench_problems()

    def _wrench_problems(self) -> list[str]:
        wrench = self.decoder.wrench
        if wrench.bias is not None and wrench.estimate is not None and wrench.bias.problem:
            return [f"The bias of the wrench is kept as first estimated: {wrench.bias.problem}."]
        return [UNKNOWN_BIAS] if wrench.waits_for_bias else []
