# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of /tf and /tf_static, as far as they are needed, and poses at stamps that all transforms have reached."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.topic_input import LIMIT
from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.fields.transforms import Edge, TransformError, TransformTree, joined, read_edges
from push_predictor.types import Array, BoolArray, IntArray

KEPT = 5_000_000_000  # ns of samples that are kept after their pose was returned
SILENT = 60_000_000_000  # ns of samples that are kept for a frame without a pose so far


@dataclass
class History:
    """The samples of an edge that are kept; first: number of the first of them, counted from the beginning.

    set_back: how many were dropped because the clock was set back.
    """

    edge: Edge
    first: int = 0
    set_back: int = 0

    def add(self, child: str, later: Edge) -> bool:
        """Add samples; whether the clock was set back: those before that are dropped. Raises TransformError."""
        self.edge = joined(child, self.edge, later)
        jumps = np.flatnonzero(np.diff(self.edge.stamp) < -CLOCK_SET)
        old = int(jumps[-1]) + 1 if len(jumps) else 0
        self.set_back += old
        self.drop(old)
        return len(jumps) > 0

    def drop(self, count: int) -> None:
        """Drop the oldest samples."""
        self.edge = replace(self.edge, stamp=self.edge.stamp[count:], rows=self.edge.rows[count:])
        self.first += count


@dataclass
class Progress:
    """How far the poses of a frame were taken: samples of the edge below `leader`, up to the stamp `newest` (ns)."""

    leader: str = ""
    done: int = 0
    newest: int | None = None


class TransformBuffer:
    """Messages of /tf and /tf_static until all who follow a frame have taken its poses.

    world: the frame in which poses are given; empty: the root of the tree above the first frame that is followed, once
    all its transforms have come for a second. from_log: transforms have the time of receipt, or of the log. unread,
    read: messages that wait, and those that were read since poses were taken. unreadable: number of messages. problem:
    why transforms are not used, empty if they are. Call `put` in any thread, the others in one.
    """

    def __init__(self, world: str = "", from_log: bool = False) -> None:
        self.world, self._from_log = world, from_log
        self._given = bool(world)
        self.dropped = self.unreadable = self.unread = self.read = 0
        self.problem = ""
        self.histories: dict[str, History] = {}
        self._followed: list[tuple[str, Progress]] = []
        self._wanted: dict[str, int | None] = {}  # by who asks for single stamps, from which (ns) on
        self._waiting: list[tuple[Messages, bool]] = []
        self._lock = threading.Lock()

    def __len__(self) -> int:
        """How many messages came since poses were taken."""
        return self.unread + self.read

    def follow(self, frame: str) -> Progress:
        """Keep what the poses of a frame need; the caller updates how far it has taken them."""
        self._followed.append((frame, Progress()))
        return self._followed[-1][1]

    def put(self, messages: Messages, static: bool, arrived: IntArray | None = None) -> None:
        """Add messages, of /tf_static if static. arrived (n,) ns: of live ones; beyond LIMIT the oldest are dropped."""
        if self._from_log and arrived is not None:
            messages = replace(messages, times=arrived)
        with self._lock:
            self._waiting.append((messages, static))
            self.unread += len(messages)
            while arrived is not None and self.unread > LIMIT:
                old = len(self._waiting.pop(0)[0])
                self.dropped, self.unread = self.dropped + old, self.unread - old

    def tree(self) -> TransformTree:
        """The transforms that are kept."""
        self._absorb()
        return TransformTree({child: history.edge for child, history in self.histories.items()})

    def root(self, tree: TransformTree) -> str:
        """The frame in which poses are given. Raises TransformError."""
        return self.world or tree.root(self._followed[0][0])

    def other_root(self, tree: TransformTree) -> TransformError | None:
        """That the tree has grown above the frame that was its root at first, if it has."""
        if self._given or not self.world or (root := tree.root(self._followed[0][0])) == self.world:
            return None
        text = f"poses are given in {self.world!r}, but the root of the tree is now {root!r}; set world_frame"
        return TransformError(text)

    def at(self, frame: str, world: str, stamp: IntArray, asks: str, last: bool = False) -> tuple[BoolArray, Array]:
        """Which stamps (n,) ns all transforms of a frame have reached, and its poses (k, 7) in another at these.

        A row is NaN at a stamp before a transform began, or in a dropout of it. asks: who does, for whom transforms
        are kept; last: no more will come. Raises TransformError.
        """
        tree = self.tree()
        reached = [int(edge.stamp.max()) for edge in tree.not_static(frame, world).values()]
        known = np.ones(len(stamp), np.bool_) if last or not reached else stamp <= min(reached)
        found = tree.poses_at(frame, world, stamp[known])
        pending = [*stamp[~known].tolist(), *reached] or stamp.tolist()
        self._wanted[asks] = min(pending, default=self._wanted.get(asks))
        return known, found

    def _absorb(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
            self.read, self.unread = self.read + self.unread, 0
        for static in (True, False):
            if not (portions := [messages for messages, of_static in waiting if of_static is static]):
                continue
            self.problem = ""
            try:
                edges, unreadable = read_edges(portions, static, self._from_log)
                self.unreadable += unreadable
                for child, edge in edges.items():
                    self._add(child, edge)
            except TransformError as error:
                self.problem = str(error)
                self.dropped += sum(map(len, portions))

    def _add(self, child: str, edge: Edge) -> None:
        if (history := self.histories.get(child)) is None:
            self.histories[child] = History(edge)
            return
        if history.add(child, edge):
            for _, progress in self._followed:
                progress.newest = None  # of the time before
            self._wanted = dict.fromkeys(self._wanted)
        if (excess := len(history.edge.stamp) - LIMIT) > 0:  # of a frame that is not connected with the world
            history.drop(excess)
            self.dropped += excess

    def forget(self) -> None:
        """Drop samples that nobody needs any more; call it when all have taken, for who has not is not known yet."""
        known = [*(progress.newest for _, progress in self._followed), *self._wanted.values()]
        if not known:
            return
        for child, history in self.histories.items():
            # Of a frame without a pose so far, nobody knows which samples it will need.
            silent = int(history.edge.stamp.max()) - SILENT
            newest = min(silent if stamp is None else stamp for stamp in known)
            needed = [progress.done - history.first for _, progress in self._followed if progress.leader == child]
            old = np.flatnonzero(history.edge.stamp >= newest - KEPT)
            count = min([int(old[0]) if len(old) else len(history.edge.stamp) - 1, *needed])
            if not history.edge.static and count > 0:
                history.drop(count)
