# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The poses of slider or tip in the world: from the messages of a topic, or of a frame of tf."""

from __future__ import annotations

from collections import Counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from push_predictor.recordings.decoder.rules import NO_TRANSFORM, Rules, broken, usable
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.fields.pose_rows import composed
from push_predictor.recordings.fields.sources import POSE_TARGET, Source
from push_predictor.recordings.fields.transforms import TransformError
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array, IntArray

Names: TypeAlias = NDArray[np.str_]
WAIT = 2_000_000_000  # ns that a pose in another frame waits for its transform


class PoseTopic:
    """Poses in the messages of a topic. name: of the stream.

    topics.world: the frame into which tf turns poses that name another, '' to take them as they are; then headers must
    name the frame `expected`, '' for any.
    """

    def __init__(
        self, name: str, source: Source, rules: Rules, tf: TransformBuffer, topics: Topics, expected: str
    ) -> None:
        self.messages = TopicInput(source, POSE_TARGET, "" if topics.world else expected, topics.from_log)
        self.problem = ""  # why poses are not turned
        self._name, self._rules, self._tf = name, rules, tf
        self._world = topics.world
        self._stamp, self._values = np.empty(0, np.int64), np.empty((0, 7))
        self._frame: Names = np.empty(0, np.str_)

    def __len__(self) -> int:
        return len(self.messages) + len(self._stamp)

    def take(self, last: bool = False) -> tuple[IntArray, Array]:
        """Stamps (n,) in ns and poses (n, 7) of the usable samples since the last call; last: no more will come."""
        columns = self.messages.usable(self._rules)
        if not self._world:
            return columns.stamp, columns.values
        return self._turned(columns.stamp, columns.values, columns.frame_names(), last)

    def _turned(self, stamp: IntArray, values: Array, frame: Names, last: bool) -> tuple[IntArray, Array]:
        """The poses in the world whose transforms have come; those after one that waits wait as well."""
        if len(stamp) and len(self._stamp) and self._stamp.max() - stamp[-1] > CLOCK_SET:  # all that waits is old
            self.messages.rejected[NO_TRANSFORM] += len(self._stamp)
            self._stamp, self._values, self._frame = self._stamp[:0], self._values[:0], self._frame[:0]
        stamp, values = np.concatenate([self._stamp, stamp]), np.concatenate([self._values, values])
        frame = np.concatenate([self._frame, frame])
        turned, known, without = values.copy(), np.ones(len(stamp), np.bool_), np.zeros(len(stamp), np.bool_)
        for name in sorted({*frame.tolist()} - {"", self._world}):
            rows = np.flatnonzero(frame == name)
            try:
                if not self._tf.tree().edges:
                    raise TransformError(
                        f"the poses are in frame {name!r}, and there is no /tf from there to {self._world!r}"
                    )
                known[rows], poses = self._tf.at(name, self._world, stamp[rows], f"{self._name} {name}", last)
                self.problem = ""
            except TransformError as error:
                known[rows], poses, self.problem = False, np.empty((0, 7)), str(error)
            at = rows[known[rows]]
            turned[at], without[at] = composed(poses, values[at]), np.isnan(poses).any(axis=1)
        expired = ~known & (last | (stamp < stamp.max(initial=0) - WAIT))
        waits = ~known & ~expired
        end = int(np.argmax(waits)) if waits.any() else len(stamp)
        if gone := int(np.sum((without | expired)[:end])):
            self.messages.rejected[NO_TRANSFORM] += gone
        self._stamp, self._values, self._frame = stamp[end:], values[end:], frame[end:]
        ready = np.flatnonzero(~(without | expired)[:end])
        return stamp[ready], turned[ready]


class PoseFrame:
    """Poses of a frame of tf. rejected: unusable samples, by fault."""

    def __init__(self, source: Source, rules: Rules, tf: TransformBuffer) -> None:
        self.source, self._rules, self._tf = source, rules, tf
        self._broken: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._tf)

    @property
    def received(self) -> int:
        """How many samples there have been."""
        return self._tf.received(self.source.frame)

    @property
    def rejected(self) -> Counter[str]:
        """Unusable samples, by fault."""
        return self._broken + self._tf.rejected(self.source.frame)

    @property
    def dropped(self) -> int:
        """Messages of tf that were dropped before their poses were taken."""
        return self._tf.dropped

    @property
    def named(self) -> frozenset[str]:
        """The frame in which the poses are, once it is known."""
        return frozenset({self._tf.world} - {""})

    @property
    def problem(self) -> str:
        """Why there are no poses, empty if there are."""
        return self._tf.problem(self.source.frame)

    @property
    def lacks_world(self) -> bool:
        """Whether there are no poses because the world is in no transform."""
        return self._tf.lacks_world(self.source.frame)

    def take(self, last: bool = False) -> tuple[IntArray, Array]:
        """See PoseTopic."""
        stamp, rows = self._tf.take(self.source.frame, last)
        kept = usable(broken(rows, self._rules), self._broken)
        return stamp[kept], rows[kept]
