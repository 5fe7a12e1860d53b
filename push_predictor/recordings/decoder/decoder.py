# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Messages in, samples out, in any portions: the one way from a bag or live topics to the streams of a recording.

A recording that is read is one portion; live topics are many. Whatever the portions, and in whatever order topics come,
the samples are the same; only a bias of the wrench is that of the free motion so far.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.poses import PoseFrame, PoseTopic
from push_predictor.recordings.decoder.rules import (
    OTHER_CLOCK,
    PUSHER,
    SCALAR,
    SLIDER,
    has_orientation,
    pusher_stream,
    slider_stream,
    usable,
)
from push_predictor.recordings.decoder.sources import COVARIATE, POSES, STATIC, TF, sources_of
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.decoder.wrench import WrenchInput
from push_predictor.recordings.fields.pose_rows import bodies_z_up, z_up
from push_predictor.recordings.fields.sources import SCALAR_TARGET, TF_TYPES, Source
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, ScalarStream, WrenchStream, taken
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array, IntArray

_RULES = {"slider": SLIDER, "pusher": PUSHER}
FAR = 3_600_000_000_000  # ns from the poses' stamps, at which the stamp of a scalar is of another clock


@dataclass(frozen=True, eq=False)
class Samples:
    """A portion of each stream; scalars: of each scalar topic that was declared, by its name in a recording."""

    slider: PoseStream
    pusher: PoseStream
    wrench: WrenchStream
    scalars: Mapping[str, ScalarStream] = field(default_factory=dict)

    def __len__(self) -> int:
        """How many samples of the sensors."""
        return len(self.slider) + len(self.pusher) + len(self.wrench)


class StreamDecoder:
    """Decodes the messages of the topics. expected: frame that headers must name where no world is given, '' for any.

    A leading slash of a topic's name makes no difference. poses: by stream; scalars: by name in a recording. headless:
    number of tip poses without orientation. `put` may be called in any thread, the others in one.
    """

    def __init__(self, topics: Topics, expected: str = "") -> None:
        self.topics = topics
        named = sources_of(topics)
        sources = {name: source for name, source in named if name != COVARIATE}
        self.tf = _buffers(topics, sources, expected)
        first = next(iter(self.tf.values()), TransformBuffer())
        self.poses: dict[str, PoseTopic | PoseFrame] = {
            name: PoseFrame(source, rules, self.tf[key_of(source.topic)])
            if (source := sources[name]).frame
            else PoseTopic(name, source, rules, first, topics, expected)
            for name, rules in _RULES.items()
        }
        self.wrench = WrenchInput(sources["wrench"], topics, first, "" if topics.world else expected)
        self.scalars = {name_of(source): self._scalar_input(source) for name, source in named if name == COVARIATE}
        self.headless = 0
        self._span: tuple[int, int] | None = None  # of the stamps (ns) of the last poses

    def add_scalar(self, source: Source) -> TopicInput:
        """Decode a further scalar."""
        return self.scalars.setdefault(name_of(source), self._scalar_input(source))

    def _scalar_input(self, source: Source) -> TopicInput:
        return TopicInput(source, SCALAR_TARGET, from_log=self.topics.from_log)

    def inputs(self) -> dict[str, TopicInput]:
        """The inputs that are messages of a topic, by stream or name of the scalar."""
        topics = {name: pose.messages for name, pose in self.poses.items() if isinstance(pose, PoseTopic)}
        return {**topics, "wrench": self.wrench.messages, **self.scalars}

    def __len__(self) -> int:
        """How many messages of the sensors wait."""
        return sum(map(len, self.poses.values())) + len(self.wrench.messages)

    def of(self, stream: str) -> TopicInput | PoseFrame:
        """What counts the samples of a stream."""
        pose = self.poses.get(stream)
        return pose if isinstance(pose, PoseFrame) else self.inputs()[stream]

    def problem(self, stream: str) -> str:
        """Why slider, pusher or wrench has no samples, or is not turned; empty if there is no reason."""
        return (self.wrench if stream == "wrench" else self.poses[stream]).problem

    def begin(self, rig: Rig) -> None:
        """Begin a run: the samples that are taken from now on are of this rig."""
        self.wrench.begin(rig)

    def put(self, messages: Messages, arrived: IntArray | None = None) -> None:
        """Add messages of a topic; those that no stream needs are ignored. arrived (n,): when, ns, of live ones."""
        key = key_of(messages.topic)
        if (buffer := self.tf.get(key.removesuffix(STATIC))) is not None and messages.type in TF_TYPES:
            buffer.put(messages, key.endswith(STATIC), arrived)
            return
        for each in self.inputs().values():
            if key_of(each.source.topic) == key and each.kind:
                each.put(messages, arrived)

    def take(self, last: bool = False) -> Samples:
        """The usable samples that are known with the messages since the last call; last: no more will come."""
        slider, pusher = (self._taken(name, last) for name in POSES)
        for stamp, _ in (slider, pusher):
            self._span = (int(stamp.min()), int(stamp.max())) if len(stamp) else self._span
        self.headless += int(np.sum(~has_orientation(pusher[1])))
        self.wrench.world, self.wrench.named = self.world, self.named
        slider = slider[0], bodies_z_up(slider[1], self.topics.up_of("slider"))
        wrench = self.wrench.take(slider, pusher, last)
        for buffer in self.tf.values():
            buffer.forget()
        pusher = pusher[0], bodies_z_up(pusher[1], self.topics.up_of("pusher"))
        return Samples(slider_stream(*slider), pusher_stream(*pusher), wrench, self.take_scalars(last))

    def _taken(self, name: str, last: bool) -> tuple[IntArray, Array]:
        """Stamps (n,) ns and poses (n, 7) of slider or pusher in a world whose z axis is up."""
        stamp, values = self.poses[name].take(last)
        return stamp, z_up(values, self.topics.up_of(name))

    def take_scalars(self, last: bool = False) -> dict[str, ScalarStream]:
        """The samples of the scalars alone; they wait for the first pose, which has the right clock."""
        if self._span is None and not last:
            return {}
        return {name: _scalar(each, self._span) for name, each in self.scalars.items() if each.kind}

    @property
    def world(self) -> str:
        """The frame in which the poses are, '' unless it is given or known from tf."""
        return self.topics.world or next((buffer.world for buffer in self.tf.values() if buffer.world), "")

    @property
    def named(self) -> frozenset[str]:
        """The frames that the poses name, without a given world, into which they are turned."""
        if self.topics.world:
            return frozenset({self.topics.world})
        return frozenset(name for stream in POSES for name in self.of(stream).named)


def key_of(topic: str) -> str:
    """A topic's name without the slashes around it."""
    return topic.strip("/")


def name_of(source: Source) -> str:
    """The name of a scalar in a recording, with a slash before it."""
    return f"/{source.text.strip('/')}"


def _buffers(topics: Topics, sources: Mapping[str, Source], expected: str) -> dict[str, TransformBuffer]:
    """The transforms by topic, of the needed ones; the first has the wrench's frame, and turns poses into the world.

    Where the other pose comes from a topic, poses from tf are given in the frame that its headers must name.
    """
    poses = [sources[name] for name in POSES]
    frames = [source for source in poses if source.frame]
    world = topics.world or ("" if len(frames) == len(poses) else expected)
    names = [*dict.fromkeys(key_of(source.topic) for source in frames)]
    if not names and (topics.world or topics.wrench_tf_frame):
        names = [key_of(TF)]
    return {name: TransformBuffer(world, topics.from_log) for name in names}


def _scalar(each: TopicInput, span: tuple[int, int] | None) -> ScalarStream:
    """The usable samples of a scalar; span: of the stamps (ns) of the poses, None if it is not known."""
    columns = each.usable(SCALAR)
    if span is not None:
        far = (columns.stamp < span[0] - FAR) | (columns.stamp > span[1] + FAR)
        columns = taken(columns, usable({OTHER_CLOCK: far}, each.rejected))
    return ScalarStream(columns.stamp, columns.values[:, 0])
