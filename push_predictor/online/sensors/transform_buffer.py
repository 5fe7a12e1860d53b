# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Live transforms: messages of /tf and /tf_static, composed into poses by the code that reads recordings."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from push_predictor.online.message_buffer import LIMIT
from push_predictor.recordings.fields.sources import TF_TYPES
from push_predictor.recordings.fields.transforms import Edge, TransformError, TransformTree, joined, read_tree
from push_predictor.types import Array, BoolArray, IntArray

NO_TRANSFORM, SET_BACK = "without transform", "clock set back"
KEPT = 5_000_000_000  # ns of samples that are kept after their pose was returned
BACK = 1_000_000_000  # ns by which a stamp falls back when the clock is set back or a replay loops
FINER = 1.2  # factor in the number of samples at which another edge gives the stamps


@dataclass
class _History:
    """The samples of an edge that are kept; first: number of the first of them, counted from the beginning."""

    edge: Edge
    first: int = 0

    @property
    def count(self) -> int:
        """How many samples there have been."""
        return self.first + len(self.edge.stamp)

    def add(self, child: str, later: Edge) -> bool:
        """Add samples; whether the clock was set back: those before that are dropped. Raises TransformError."""
        self.edge = joined(child, self.edge, later)
        jumps = np.flatnonzero(np.diff(self.edge.stamp) < -BACK)
        self.drop(int(jumps[-1]) + 1 if len(jumps) else 0)
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
    problem: str = ""


class TransformBuffer:
    """Messages of /tf and /tf_static until they are taken as poses of frames.

    frames: those whose poses are wanted. world: the frame in which poses are given; empty: the root of the tree above
    the first frame, once it is known. turned: a frame whose poses are wanted at given stamps, '' for none. Call `put`
    in any thread, the others in one.
    """

    def __init__(self, frames: Sequence[str], world: str = "", turned: str = "") -> None:
        self.world = world
        self._given = bool(world)
        self.dropped = 0
        self._frames = list(frames)
        self._turned = turned
        self._turned_from: int | None = None  # stamp (ns) from which on its poses may still be wanted
        self.turned_problem = ""  # why `turned` has no poses, empty if it has
        self._progress = {frame: _Progress() for frame in frames}
        self._histories: dict[str, _History] = {}
        self._waiting: list[tuple[bytes, bool]] = []
        self._read = 0  # messages that were read since poses were taken
        self._problem = ""
        self._lock = threading.Lock()

    def __len__(self) -> int:
        """How many messages came since poses were taken."""
        return len(self._waiting) + self._read

    def put(self, data: bytes, static: bool) -> None:
        """Add a message, of /tf_static if static."""
        with self._lock:
            self._waiting.append((data, static))
            if len(self._waiting) > LIMIT:
                self.dropped += LIMIT // 10
                del self._waiting[: LIMIT // 10]

    def take(self, frame: str) -> tuple[IntArray, Array]:
        """Stamps (n,) in ns and rows (n, 7: x, y, z, quaternion) of a frame since the last call, in order of arrival.

        A sample waits until all transforms between the frame and the world have come as far.
        """
        self._absorb()
        self._read = 0
        progress, tree = self._progress[frame], self._tree()
        try:
            self.world = self.world or tree.root(self._frames[0])
            found = self._new_poses(frame, tree)
            progress.problem = self._other_root(tree)
        except TransformError as error:
            progress.problem = str(error)
            return np.zeros(0, np.int64), np.zeros((0, 7))
        self._forget()
        return found

    def at(self, stamp: IntArray) -> tuple[BoolArray, Array]:
        """Which stamps (n,) ns all transforms of the frame `turned` have reached, and its poses (k, 7) at these.

        A row is NaN at a stamp before a transform began, or in a dropout of it. The poses are in the world, as far as
        tf has it, else in the root above the frame.
        """
        self._absorb()
        tree, frame = self._tree(), self._turned
        try:
            world = self.world if self.world in tree.frames else tree.root(frame)
            reached = [int(edge.stamp.max()) for edge in tree.not_static(frame, world).values()]
            decided = stamp <= min(reached) if reached else np.ones(len(stamp), dtype=np.bool_)
            found = tree.poses_at(frame, world, stamp[decided])
            self.turned_problem = ""
        except TransformError as error:
            self.turned_problem = str(error)
            return np.zeros(len(stamp), dtype=np.bool_), np.zeros((0, 7))
        pending = [*stamp[~decided].tolist(), *reached] or stamp.tolist()
        self._turned_from = min(pending, default=self._turned_from)
        self._forget()
        return decided, found

    def recent(self, frame: str, count: int) -> IntArray:
        """The newest stamps (n,) in ns of a frame's transforms, at most `count`; none without a connection."""
        self._absorb()
        tree = self._tree()
        try:
            moving = tree.moving(frame, self.world or tree.root(self._frames[0]))
        except TransformError as error:
            self._progress[frame].problem = str(error)
            return np.zeros(0, np.int64)
        self._progress[frame].problem = self._other_root(tree)
        return self._histories[self._leader(frame, moving)].edge.stamp[-count:]

    def received(self, frame: str) -> int:
        """How many samples of a frame there have been."""
        return self._progress[frame].received

    def rejected(self, frame: str) -> Counter[str]:
        """Samples of a frame that have no pose, by reason."""
        return self._progress[frame].rejected

    def problem(self, frame: str) -> str:
        """Why a frame has no poses, empty if it has."""
        return self._problem or self._progress[frame].problem

    def _other_root(self, tree: TransformTree) -> str:
        """In words, that the tree has grown above the frame that was its root at first; empty if not."""
        if self._given or not self.world or (root := tree.root(self._frames[0])) == self.world:
            return ""
        return f"poses are given in {self.world!r}, but the root of the tree is now {root!r}; set world_frame"

    def _tree(self) -> TransformTree:
        return TransformTree({child: history.edge for child, history in self._histories.items()})

    def _absorb(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
            self._read += len(waiting)
        for static in (True, False):
            if not (messages := [data for data, is_static in waiting if is_static is static]):
                continue
            self._problem = ""
            try:
                for child, edge in read_tree([(messages, TF_TYPES[0], static)]).edges.items():
                    self._add(child, edge)
            except TransformError as error:
                self._problem = str(error)
                self.dropped += len(messages)

    def _add(self, child: str, edge: Edge) -> None:
        if (history := self._histories.get(child)) is None:
            self._histories[child] = _History(edge)
            return
        if history.add(child, edge):
            for progress in self._progress.values():
                progress.newest = None  # of the time before
            self._turned_from = None
        if (excess := len(history.edge.stamp) - LIMIT) > 0:  # of a frame that is not connected with the world
            history.drop(excess)
            self.dropped += excess

    def _leader(self, frame: str, moving: dict[str, Edge]) -> str:
        """The child frame of the edge with the most samples; another than before only if it has clearly more."""
        before, count = self._progress[frame].leader, {name: self._histories[name].count for name in moving}
        best = max(count, key=lambda name: count[name])
        return before if before in count and count[best] <= FINER * count[before] else best

    def _new_poses(self, frame: str, tree: TransformTree) -> tuple[IntArray, Array]:
        moving, progress = tree.moving(frame, self.world), self._progress[frame]
        leader = self._leader(frame, moving)
        history = self._histories[leader]
        start = self._start(progress, leader, history)
        stamp = history.edge.stamp[start:]
        known = min((int(edge.stamp.max()) for name, edge in moving.items() if name != leader), default=None)
        late = np.flatnonzero(stamp > known) if known is not None else np.zeros(0, np.int64)
        end = start + (int(late[0]) if len(late) else len(stamp))
        ready = replace(history.edge, stamp=history.edge.stamp[start:end], rows=history.edge.rows[start:end])
        stamp, rows, without = TransformTree({**tree.edges, leader: ready}).poses(frame, self.world, leader)
        progress.leader, progress.done = leader, history.first + end
        progress.newest = int(ready.stamp[-1]) if len(ready.stamp) else progress.newest
        progress.received += end - start
        if without:
            progress.rejected[NO_TRANSFORM] += without
        return stamp, rows

    def _start(self, progress: _Progress, leader: str, history: _History) -> int:
        """The place of the first sample whose pose was not returned yet."""
        if progress.leader and progress.leader != leader and progress.newest is not None:
            return int(np.sum(history.edge.stamp <= progress.newest))
        if progress.done < history.first and progress.leader:
            progress.rejected[SET_BACK] += history.first - progress.done
        return max(progress.done - history.first, 0)

    def _forget(self) -> None:
        """Drop samples that no frame needs any more."""
        known = [progress.newest for progress in self._progress.values()]
        known += [self._turned_from] if self._turned else []
        newest = [stamp for stamp in known if stamp is not None]
        if len(newest) < len(known):
            return
        for child, history in self._histories.items():
            needed = [p.done - history.first for p in self._progress.values() if p.leader == child]
            old = np.flatnonzero(history.edge.stamp >= min(newest) - KEPT)
            count = min([int(old[0]) if len(old) else len(history.edge.stamp) - 1, *needed])
            if not history.edge.static and count > 0:
                history.drop(count)
