# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The subscriptions to tracker, robot and force sensor; their samples are taken in portions."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from time import monotonic
from typing import TypeAlias

import numpy as np
from rclpy.node import Node

from push_predictor.nodes.validator.scalar_subscriber import ScalarSubscriber
from push_predictor.nodes.validator.sensors.frame_stream import FrameStream, TransformTopics
from push_predictor.nodes.validator.sensors.stream_source import sources_of
from push_predictor.nodes.validator.sensors.topic_stream import TopicStream
from push_predictor.nodes.validator.sensors.wrench_axes import WrenchAxes
from push_predictor.online.sensors.live_wrench import LiveWrench
from push_predictor.online.sensors.topic_report import ReportLog, TopicReport
from push_predictor.online.stream_sync import Samples
from push_predictor.recordings.fields.sources import Source
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.samples import (
    PUSHER,
    SLIDER,
    SPATIAL_WRENCH,
    WRENCH,
    pusher_stream,
    slider_stream,
)
from push_predictor.recordings.select import STREAMS, TF
from push_predictor.recordings.streams import ScalarStream
from push_predictor.recordings.topics import Topics

PERIOD = 0.01  # s between two looks into the middleware, which keeps the last messages only
LOOK = 0.05  # s between two looks at the publishers
PATIENCE = 1.0  # s that a run waits for the first message of every topic
WORLD = "world"
RULES = {"slider": SLIDER, "pusher": PUSHER, "wrench": WRENCH}

Stream: TypeAlias = TopicStream | FrameStream


class SensorSubscriber:
    """Subscribes to slider, pusher and wrench, as topics of any type with a pose or wrench or as frames of tf.

    topics: where the streams are; slider/pose, pusher/pose and pusher/wrench where they are not given. frame_id: frame
    that the headers must name, empty for any; topics.world replaces it. scalars: the scalar topics to subscribe to as
    well. A thread empties the middleware's queues: a fast replay fills them while a portion of samples is processed.
    Raises RequestError for a source that is not valid.
    """

    def __init__(self, node: Node, topics: Topics, frame_id: str, scalars: Sequence[str] = ()) -> None:
        sources = sources_of(topics)
        self._scalars = ScalarSubscriber(node, scalars)
        self._newest: int | None = None  # stamp (ns) of the poses
        self._frame_id = topics.world or frame_id
        self._tf = _transform_topics(node, sources, topics, self._frame_id)
        self._wrench_axes = WrenchAxes(topics, next(iter(self._tf.values()), None))
        self._wrench = LiveWrench(topics, self._wrench_axes.buffer)
        self._streams = {name: self._stream(node, name, source) for name, source in sources.items()}
        self._buffers = {name: stream.buffer for name, stream in self._streams.items()}
        self._log = ReportLog()
        self._reports: list[TopicReport] = []
        self._empty = monotonic()  # when nothing waited last
        self._settled = not self._tf or bool(topics.world)  # whether the frame of poses is known from the first message
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
        return sum(map(len, self._buffers.values()))

    def complete(self) -> bool:
        """Whether messages of every topic wait, or messages of some topic have waited for PATIENCE.

        Call it often: it measures the time since no message waited. Frames of tf always wait for PATIENCE, unless the
        world is given: only a whole tree has the right root.
        """
        waiting = [len(buffer) > 0 for buffer in self._buffers.values()]
        if not any(waiting):
            self._empty = monotonic()
        early = all(waiting) and self._scalars.waiting() and self._settled
        return early or monotonic() - self._empty > PATIENCE

    @property
    def world(self) -> str:
        """The frame in which the poses are."""
        found = next((topics.buffer.world for topics in self._tf.values()), "")
        return found or self._frame_id or WORLD

    @property
    def scalar_names(self) -> list[str]:
        """The requested scalar topics, published or not, by their names in a recording."""
        return self._scalars.names

    def look(self) -> None:
        """Subscribe as the present publishers offer their topics; call often, in the executor's thread."""
        self._scalars.look()
        if monotonic() - self._looked < LOOK:
            return
        self._looked = monotonic()
        with self._draining:
            for stream in self._subscribed():
                stream.move()
                stream.look()

    def drain(self) -> None:
        """Move arrived messages from the middleware into the buffers."""
        self._scalars.drain()
        with self._draining:  # one at a time, so that messages stay in order
            for stream in self._subscribed():
                stream.move()

    def _subscribed(self) -> list[TopicStream | TransformTopics]:
        streams = [stream for stream in self._streams.values() if isinstance(stream, TopicStream)]
        return [*streams, *self._tf.values()]

    def _stream(self, node: Node, name: str, source: Source) -> Stream:
        if source.frame:
            return FrameStream(node, name, source, self._tf[source.topic], RULES[name])
        if name == "wrench" and self._wrench_axes.turned:  # its headers name the sensor's frame
            return TopicStream(node, name, source, STREAMS[name], SPATIAL_WRENCH, "")
        return TopicStream(node, name, source, STREAMS[name], RULES[name], self._frame_id)

    def _drain_repeatedly(self) -> None:
        while not self._ending.wait(PERIOD):
            self.drain()

    def begin(self, rig: Rig) -> None:
        """Begin a run: the samples that are taken from now on are of this rig."""
        self._wrench.begin(rig)

    @property
    def waits_for_bias(self) -> bool:
        """Whether the wrench is held back because its bias is not known yet."""
        return self._wrench.waits_for_bias

    def take(self) -> Samples:
        """The usable samples since the last call."""
        self._empty = monotonic()
        slider, pusher, wrench = (self._buffers[name].take() for name in STREAMS)
        turned = self._wrench.put(wrench, slider, pusher)
        for stamp, _ in (slider, pusher):
            self._newest = int(np.median(stamp)) if len(stamp) else self._newest  # a single stamp may be wrong
        scalars = self._scalars.take(self._newest)
        return Samples(slider_stream(*slider), pusher_stream(*pusher), turned, scalars)

    def last_scalars(self) -> dict[str, ScalarStream]:
        """The scalars since the last sample of a sensor."""
        return self._scalars.take(self._newest, last=True)

    def inspect(self) -> list[TopicReport]:
        """Make the reports about the topics anew, and return those to log."""
        with self._draining:
            reports = [stream.report() for stream in self._streams.values()]
        self._reports = [self._wrench_axes.amended(each) if each.stream == "wrench" else each for each in reports]
        return self._log.news(self._reports)

    @property
    def refused(self) -> bool:
        """Whether a topic cannot be used as it is, by the last inspection."""
        return any(report.refused for report in self._reports)

    def figures(self) -> dict[str, object]:
        """The report about each topic, counts of its messages, and of rejected ones by the kinds that occurred."""
        found: dict[str, object] = {f"{report.stream} topic": report.line for report in self._reports}
        for name, stream in self._streams.items():
            buffer = stream.buffer
            rejected = buffer.rejected
            found |= {f"{name} samples": buffer.received, f"{name} rejected": rejected.total()}
            found |= {f"{name} rejected {kind}": count for kind, count in rejected.items()}
            if buffer.dropped:
                found[f"{name} dropped"] = buffer.dropped
            if stream.lost:
                found[f"{name} lost"] = stream.lost
        return found | self._wrench.figures() | self._scalars.figures()

    def problems(self) -> list[str]:
        """What keeps pushes from being found, in words; about the topics by the last inspection."""
        found = []
        for report in self._reports:
            buffer, topic = self._buffers[report.stream], report.topic
            lost, rejected = self._streams[report.stream].lost, buffer.rejected
            if report.problem:
                found.append(f"{topic}: {report.problem}")
            if rejected:
                kinds = ", ".join(f"{kind} {count}" for kind, count in rejected.items())
                found.append(f"{topic}: {rejected.total()} of {buffer.received} samples were rejected ({kinds}).")
            if lost:
                found.append(f"{topic}: {lost} samples were lost. Replay slower, or use a deeper queue (QoS).")
            if buffer.dropped:
                found.append(f"{topic}: {buffer.dropped} samples were dropped before they could be used.")
        return found + self._wrench.problems + self._scalars.problems()


def _transform_topics(
    node: Node, sources: dict[str, Source], topics: Topics, frame_id: str
) -> dict[str, TransformTopics]:
    """The tf topics of all sources that are frames and of the wrench's axes, by their name as given.

    Where the other pose comes from a topic, poses from tf are given in the frame that its headers must name. The
    frame of the wrench is in the first tf topic.
    """
    poses = [source for name, source in sources.items() if name != "wrench"]
    frames = [source for source in poses if source.frame]
    common = topics.world if len(frames) == len(poses) else frame_id
    names = [*dict.fromkeys(source.topic for source in frames)]
    turned = topics.wrench_tf_frame
    if turned and not names:
        names = [TF]
    return {
        name: TransformTopics(
            node,
            name,
            [source.frame for source in frames if source.topic == name],
            common,
            turned if name == names[0] else "",
        )
        for name in names
    }
