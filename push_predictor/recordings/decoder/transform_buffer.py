# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of /tf and /tf_static, composed into poses as far as all transforms on the way have come."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.rules import NO_TRANSFORM
from push_predictor.recordings.decoder.topic_input import LIMIT
from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.fields.transforms import Edge, TransformError, TransformTree, joined, read_tree
from push_predictor.types import Array, BoolArray, IntArray

SET_BACK = "clock set back"
KEPT = 5_000_000_000  # ns of samples that are kept after their pose was returned
SILENT = 60_000_000_000  # ns of samples that are kept for a frame without a pose so far
SETTLING = 1_000_000_000  # ns of all transforms of a frame that decide which of them gives the stamps


@dataclass
class _History:
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
class _Progress:
    """How far the poses of a frame were returned: samples of the edge below `leader`, up to the stamp `newest`."""

    leader: str = ""
    done: int = 0
    newest: int | None = None
    received: int = 0
    rejected: Counter[str] = field(default_factory=Counter)
    problem: TransformError | None = None


class TransformBuffer:
    """Messages of /tf and /tf_static until they are taken as poses of frames.

    frames: those whose poses are wanted. world: the frame in which poses are given; empty: the root of the tree above
    the first frame, once all its transforms have come for a second. from_log: transforms have the time of receipt, or
    of the log. unreadable: number of messages. Call `put` in any
    thread, the others in one.
    """

    def __init__(self, frames: Sequence[str], world: str = "", from_log: bool = False) -> None:
        self.world, self._from_log = world, from_log
        self._given = bool(world)
        self.dropped = self.unreadable = 0
        self._frames = list(frames)
        self._progress = {frame: _Progress() for frame in frames}
        self._wanted: dict[str, int | None] = {}  # by who asks for single stamps, from which (ns) on
        self._histories: dict[str, _History] = {}
        self._waiting: list[tuple[Messages, bool]] = []
        self._unread = self._read = 0  # messages that wait, and those that were read since poses were taken
        self._problem = ""
        self._lock = threading.Lock()

    def __len__(self) -> int:
        """How many messages came since poses were taken."""
        return self._unread + self._read

    def put(self, messages: Messages, static: bool, arrived: IntArray | None = None) -> None:
        """Add messages, of /tf_static if static. arrived (n,) ns: of live ones; beyond LIMIT the oldest are dropped."""
        if self._from_log and arrived is not None:
            messages = replace(messages, times=arrived)
        with self._lock:
            self._waiting.append((messages, static))
            self._unread += len(messages)
            while arrived is not None and self._unread > LIMIT:
                old = len(self._waiting.pop(0)[0])
                self.dropped, self._unread = self.dropped + old, self._unread - old

    def tree(self) -> TransformTree:
        """The transforms that are kept."""
        self._absorb()
        return TransformTree({child: history.edge for child, history in self._histories.items()})

    def take(self, frame: str, last: bool = False) -> tuple[IntArray, Array]:
        """Stamps (n,) in ns and rows (n, 7: x, y, z, quaternion) of a frame since the last call, in order of arrival.

        A sample waits until all transforms between the frame and the world have come as far; last: no more will come.
        """
        tree, progress, nothing = self.tree(), self._progress[frame], (np.zeros(0, np.int64), np.zeros((0, 7)))
        self._read = 0
        try:
            world = self.world or tree.root(self._frames[0])
            moving = tree.moving(frame, world)
            if progress.leader not in moving:
                if not (leader := _leader(moving, last)):
                    return nothing
                self._lead(progress, leader)
            self.world = world
            found = self._new_poses(progress, frame, tree, moving, last)
            progress.problem = self._other_root(tree)
        except TransformError as error:
            progress.problem = error.with_traceback(None)
            return nothing
        return found

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

    def recent(self, frame: str, count: int) -> IntArray:
        """The newest stamps (n,) in ns of a frame's transforms, at most `count`; none without a connection."""
        tree, progress = self.tree(), self._progress[frame]
        try:
            moving = tree.moving(frame, self.world or tree.root(self._frames[0]))
        except TransformError as error:
            progress.problem = error.with_traceback(None)
            return np.zeros(0, np.int64)
        progress.problem = self._other_root(tree)
        leader = progress.leader if progress.leader in moving else _leader(moving, last=True)
        return moving[leader].stamp[-count:]

    def received(self, frame: str) -> int:
        """How many samples of a frame there have been."""
        return self._progress[frame].received

    def rejected(self, frame: str) -> Counter[str]:
        """Samples of a frame that have no pose, by reason."""
        return self._progress[frame].rejected

    def problem(self, frame: str) -> str:
        """Why a frame has no poses, empty if it has."""
        return self._problem or str(self._progress[frame].problem or "")

    def lacks_world(self, frame: str) -> bool:
        """Whether a frame has no poses because the world is in no transform."""
        problem = self._progress[frame].problem
        return not self._problem and problem is not None and problem.missing == self.world

    def _other_root(self, tree: TransformTree) -> TransformError | None:
        """That the tree has grown above the frame that was its root at first, if it has."""
        if self._given or not self.world or (root := tree.root(self._frames[0])) == self.world:
            return None
        text = f"poses are given in {self.world!r}, but the root of the tree is now {root!r}; set world_frame"
        return TransformError(text)

    def _absorb(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
            self._read, self._unread = self._read + self._unread, 0
        for static in (True, False):
            if not (portion := [each for each in waiting if each[1] is static]):
                continue
            self._problem = ""
            try:
                found = read_tree(portion, self._from_log)
                self.unreadable += found.unreadable
                for child, edge in found.edges.items():
                    self._add(child, edge)
            except TransformError as error:
                self._problem = str(error)
                self.dropped += sum(len(messages) for messages, _ in portion)

    def _add(self, child: str, edge: Edge) -> None:
        if (history := self._histories.get(child)) is None:
            self._histories[child] = _History(edge)
            return
        if history.add(child, edge):
            for progress in self._progress.values():
                progress.newest = None  # of the time before
            self._wanted = dict.fromkeys(self._wanted)
        if (excess := len(history.edge.stamp) - LIMIT) > 0:  # of a frame that is not connected with the world
            history.drop(excess)
            self.dropped += excess

    def _lead(self, progress: _Progress, leader: str) -> None:
        """Take the stamps of another edge from now on, from the first that is newer than the last pose."""
        history = self._histories[leader]
        if not progress.leader and history.set_back:  # before it was known whose stamps count
            progress.rejected[SET_BACK] += history.set_back
        done = 0 if progress.newest is None else int(np.sum(history.edge.stamp <= progress.newest))
        progress.leader, progress.done = leader, history.first + done

    def _new_poses(
        self, progress: _Progress, frame: str, tree: TransformTree, moving: dict[str, Edge], last: bool
    ) -> tuple[IntArray, Array]:
        leader, history = progress.leader, self._histories[progress.leader]
        if (missed := history.first - progress.done) > 0:
            progress.rejected[SET_BACK] += missed
        start = max(-missed, 0)
        stamp = history.edge.stamp[start:]
        known = min((int(edge.stamp.max()) for name, edge in moving.items() if name != leader), default=None)
        late = np.flatnonzero(stamp > known) if known is not None and not last else np.zeros(0, np.int64)
        end = start + (int(late[0]) if len(late) else len(stamp))
        ready = replace(history.edge, stamp=history.edge.stamp[start:end], rows=history.edge.rows[start:end])
        stamp, rows, without = TransformTree({**tree.edges, leader: ready}).poses(frame, self.world, leader)
        progress.done = history.first + end
        progress.newest = int(ready.stamp[-1]) if len(ready.stamp) else progress.newest
        progress.received += end - start
        if without:
            progress.rejected[NO_TRANSFORM] += without
        return stamp, rows

    def forget(self) -> None:
        """Drop samples that nobody needs any more; call it when all have taken, for who has not is not known yet."""
        known = [*(progress.newest for progress in self._progress.values()), *self._wanted.values()]
        if not known:
            return
        for child, history in self._histories.items():
            # Of a frame without a pose so far, nobody knows which samples it will need.
            silent = int(history.edge.stamp.max()) - SILENT
            newest = min(silent if stamp is None else stamp for stamp in known)
            needed = [p.done - history.first for p in self._progress.values() if p.leader == child]
            old = np.flatnonzero(history.edge.stamp >= newest - KEPT)
            count = min([int(old[0]) if len(old) else len(history.edge.stamp) - 1, *needed])
            if not history.edge.static and count > 0:
                history.drop(count)


def _leader(moving: dict[str, Edge], last: bool) -> str:
    """The child frame of the edge with the most samples in the first second of all, '' before that has passed.

    Of equal ones the nearest to the frame.
    """
    begin = max(int(edge.stamp[0]) for edge in moving.values())
    if not last and min(int(edge.stamp.max()) for edge in moving.values()) < begin + SETTLING:
        return ""
    first = {name: np.sum((edge.stamp >= begin) & (edge.stamp < begin + SETTLING)) for name, edge in moving.items()}
    return max(first, key=lambda name: int(first[name]))
