# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The poses of slider or tip in the world: from the messages of a topic, or of a frame of tf."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from push_predictor.recordings.decoder.rules import NO_TRANSFORM, Rules, broken, usable
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.fields.pose_rows import composed
from push_predictor.recordings.fields.sources import POSE_TARGET, Source
from push_predictor.recordings.fields.transforms import Edge, TransformError, TransformTree
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array, IntArray

Names: TypeAlias = NDArray[np.object_]
SET_BACK = "clock set back"
SETTLING = 1_000_000_000  # ns of all transforms of a frame that decide which of them gives the stamps
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
        self._frame: Names = np.empty(0, np.object_)

    def __len__(self) -> int:
        return len(self.messages) + len(self._stamp)

    def take(self, last: bool = False) -> tuple[IntArray, Array]:
        """Stamps (n,) in ns and poses (n, 7) of the usable samples since the last call; last: no more will come."""
        columns = self.messages.usable(self._rules)
        if not self._world:
            return columns.stamp, columns.values
        return self._turned(columns.stamp, columns.values, columns.frame, last)

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
    """Poses of a frame of tf, at the stamps of one of its transforms: of the one below the leader.

    received: how many samples there have been; rejected: unusable ones, by fault.
    """

    def __init__(self, source: Source, rules: Rules, tf: TransformBuffer) -> None:
        self.source, self._rules, self.tf = source, rules, tf
        self.received, self.rejected = 0, Counter[str]()
        self.foreign = Counter[str]()  # tf has one type
        self._progress = tf.follow(source.frame)
        self._unconnected: TransformError | None = None

    def __len__(self) -> int:
        return len(self.tf)

    @property
    def dropped(self) -> int:
        """Messages of tf that were dropped before their poses were taken."""
        return self.tf.dropped

    @property
    def named(self) -> frozenset[str]:
        """The frame in which the poses are, once it is known."""
        return frozenset({self.tf.world} - {""})

    @property
    def problem(self) -> str:
        """Why there are no poses, empty if there are."""
        return self.tf.problem or str(self._unconnected or "")

    @property
    def lacks_world(self) -> bool:
        """Whether there are no poses because the world is in no transform."""
        problem = self._unconnected
        return not self.tf.problem and problem is not None and problem.missing == self.tf.world

    def take(self, last: bool = False) -> tuple[IntArray, Array]:
        """See PoseTopic; in order of arrival. A sample waits until all transforms below the world have come as far."""
        tree, faults = self.tf.tree(), Counter[str]()
        stamp, rows = np.zeros(0, np.int64), np.zeros((0, 7))
        self.tf.read = 0
        try:
            world = self.tf.root(tree)
            moving = tree.moving(self.source.frame, world)
            if self._progress.leader in moving or self._lead(_leader(moving, last), faults):
                self.tf.world = world
                stamp, rows = self._new_poses(tree, moving, last, faults)
                self._unconnected = self.tf.other_root(tree)
        except TransformError as error:
            self._unconnected = error.with_traceback(None)
            stamp, rows = stamp[:0], rows[:0]
        kept = usable(broken(rows, self._rules), self.rejected)
        self.rejected += faults
        return stamp[kept], rows[kept]

    def recent(self, count: int) -> IntArray:
        """The newest stamps (n,) in ns of the frame's transforms, at most `count`; none without a connection."""
        tree = self.tf.tree()
        try:
            moving = tree.moving(self.source.frame, self.tf.root(tree))
            self._unconnected = self.tf.other_root(tree)
        except TransformError as error:
            self._unconnected = error.with_traceback(None)
            return np.zeros(0, np.int64)
        leader = self._progress.leader if self._progress.leader in moving else _leader(moving, last=True)
        return moving[leader].stamp[-count:]

    def _lead(self, leader: str, faults: Counter[str]) -> bool:
        """Take the stamps of another edge, if there is one, from the first that is newer than the last pose."""
        if not leader:
            return False
        history, progress = self.tf.histories[leader], self._progress
        if not progress.leader and history.set_back:  # before it was known whose stamps count
            faults[SET_BACK] += history.set_back
        done = 0 if progress.newest is None else int(np.sum(history.edge.stamp <= progress.newest))
        progress.leader, progress.done = leader, history.first + done
        return True

    def _new_poses(
        self, tree: TransformTree, moving: dict[str, Edge], last: bool, faults: Counter[str]
    ) -> tuple[IntArray, Array]:
        progress, leader = self._progress, self._progress.leader
        history = self.tf.histories[leader]
        if (missed := history.first - progress.done) > 0:
            faults[SET_BACK] += missed
        start = max(-missed, 0)
        stamp = history.edge.stamp[start:]
        known = min((int(edge.stamp.max()) for name, edge in moving.items() if name != leader), default=None)
        late = np.flatnonzero(stamp > known) if known is not None and not last else np.zeros(0, np.int64)
        end = start + (int(late[0]) if len(late) else len(stamp))
        ready = replace(history.edge, stamp=history.edge.stamp[start:end], rows=history.edge.rows[start:end])
        frame = self.source.frame
        stamp, rows, without = TransformTree({**tree.edges, leader: ready}).poses(frame, self.tf.world, leader)
        progress.done = history.first + end
        progress.newest = int(ready.stamp[-1]) if len(ready.stamp) else progress.newest
        self.received += end - start
        if without:
            faults[NO_TRANSFORM] += without
        return stamp, rows


def _leader(moving: dict[str, Edge], last: bool) -> str:
    """The child frame of the edge with the most samples in the first second of all, '' before that has passed.

    Of equal ones the nearest to the frame.
    """
    begin = max(int(edge.stamp[0]) for edge in moving.values())
    if not last and min(int(edge.stamp.max()) for edge in moving.values()) < begin + SETTLING:
        return ""
    first = {name: np.sum((edge.stamp >= begin) & (edge.stamp < begin + SETTLING)) for name, edge in moving.items()}
    return max(first, key=lambda name: int(first[name]))
