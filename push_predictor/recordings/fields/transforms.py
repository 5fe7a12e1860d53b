# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tree of frames in /tf and /tf_static, and the pose of one frame in another over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from push_predictor.recordings.bag.message_types import STANDARD
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.fields.columns import Block, BlockReader
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised, poses_at
from push_predictor.recordings.fields.sources import TF_TYPES, header_stamps
from push_predictor.types import Array, IntArray

WORLD = "world"
_NUMBERS = 9  # of a transform: two of its stamp, three of its translation, four of its rotation
_READERS = {name: BlockReader(name, STANDARD, ["transforms"]) for name in TF_TYPES}


@dataclass(frozen=True, eq=False)
class Edge:
    """The pose of a frame in its parent over time: stamps (n,) in ns in file order, rows (n, 7) as in pose_rows.

    static: from /tf_static, so that the last row is valid at all times.
    """

    parent: str
    stamp: IntArray
    rows: Array
    static: bool


class TransformError(ValueError):
    """A frame has no pose; the message states why and which frames there are. missing: the one that is not there."""

    def __init__(self, message: str, missing: str | None = None) -> None:
        super().__init__(message)
        self.missing = missing


@dataclass(frozen=True, eq=False)
class TransformTree:
    """The edges of a tree of frames, by child frame."""

    edges: dict[str, Edge]

    @property
    def frames(self) -> list[str]:
        """The names of all frames."""
        return sorted({*self.edges, *(edge.parent for edge in self.edges.values())})

    def root(self, frame: str) -> str:
        """The frame `world` if the frame descends from it, else the root of its tree. Raises TransformError."""
        above = self._ancestors(frame)
        return WORLD if WORLD in above else above[-1]

    def moving(self, frame: str, world: str) -> dict[str, Edge]:
        """The edges between two frames that are not static, by child frame. Raises TransformError if all are."""
        if not (found := self.not_static(frame, world)):
            raise TransformError(f"frame {frame!r} never moves in {world!r}: all its transforms are static")
        return found

    def not_static(self, frame: str, world: str) -> dict[str, Edge]:
        """The edges between two frames that are not static, by child frame; none if all are. Raises TransformError."""
        names = [name for part in self._chain(frame, world) for name in part]
        return {name: self.edges[name] for name in names if not self.edges[name].static}

    def poses(self, frame: str, world: str, leader: str) -> tuple[IntArray, Array, int]:
        """Stamps (n,) in ns and rows (n, 7) of a frame in another, and the number of stamps without a pose.

        Stamps are those of the edge below `leader`, in file order. The other edges are interpolated there; a stamp
        outside an edge's time, or in a dropout of it, has no pose. Raises TransformError.
        """
        up, down = self._chain(frame, world)
        finest = self.edges[leader]
        rows = self._composed(up, down, finest.stamp, finest)
        inside = ~np.isnan(rows).any(axis=1) | np.isnan(finest.rows).any(axis=1)
        return finest.stamp[inside], rows[inside], int(np.sum(~inside))

    def poses_at(self, frame: str, world: str, stamp: IntArray) -> Array:
        """Rows (n, 7) of a frame in another at stamps (n,) in ns; NaN where a transform has none.

        Raises TransformError.
        """
        return self._composed(*self._chain(frame, world), stamp)

    def _composed(self, up: Sequence[str], down: Sequence[str], stamp: IntArray, exact: Edge | None = None) -> Array:
        """The pose (n, 7) of the first frame of `up` in that of `down`; `exact` has the stamps themselves."""
        found = self._along(up, stamp, exact)
        return composed(inverted(self._along(down, stamp, exact)), found) if down else found

    def _along(self, names: Sequence[str], stamp: IntArray, exact: Edge | None) -> Array:
        """The pose (n, 7) of the first frame in the parent of the last."""
        found = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(stamp), 1))
        for name in names:
            edge = self.edges[name]
            found = composed(edge.rows if edge is exact else _at(edge, stamp), found)
        return found

    def _chain(self, frame: str, world: str) -> tuple[list[str], list[str]]:
        """The frames from `frame`, and from `world`, up to just below their nearest common ancestor."""
        one, other = self._ancestors(frame), self._ancestors(world)
        common = next((name for name in one if name in other), None)
        if common is None:
            raise TransformError(f"no transforms connect frame {frame!r} (root {one[-1]!r}) with {world!r}")
        return one[: one.index(common)], other[: other.index(common)]

    def _ancestors(self, frame: str) -> list[str]:
        """The frame, its parent and so on to the root."""
        if frame not in self.frames:
            raise TransformError(f"no frame {frame!r}; the frames are {', '.join(self.frames) or 'none'}", frame)
        found = [frame]
        while (edge := self.edges.get(found[-1])) is not None:
            if edge.parent in found:
                raise TransformError(f"frame {frame!r} is its own ancestor: {' in '.join([*found, edge.parent])}")
            found.append(edge.parent)
        return found


def read_edges(portions: Sequence[Messages], static: bool, from_log: bool = False) -> tuple[dict[str, Edge], int]:
    """The edges in messages of a tf topic, by child frame, and the number of messages that are unreadable.

    static: of the static topic. from_log: the stamps are the times of the messages, whatever their headers state.

    Raises TransformError for a frame with two parents.
    """
    found: dict[str, list[_Part]] = {}
    unreadable = begin = 0
    for messages in portions:
        read = 0
        for block in _READERS[messages.type].blocks(messages):
            read += len(block.rows)
            for number in range(len(block.paths("transforms")) // _NUMBERS):
                times = messages.times[block.rows] if from_log else None
                for child, part in _parts(block, f"transforms[{number}]", times):
                    found.setdefault(child, []).append(part._replace(rows=part.rows + begin))
        unreadable += len(messages) - read
        begin += len(messages)
    return {child: _edge(child, parts, static) for child, parts in found.items()}, unreadable


def joined(child: str, earlier: Edge, later: Edge) -> Edge:
    """An edge with later samples, of a static one only the last. Raises TransformError for another parent."""
    if earlier.parent != later.parent:
        raise _several_parents(child, [earlier.parent, later.parent])
    static = earlier.static and later.static
    begin = -1 if static else 0
    stamp, rows = np.concatenate([earlier.stamp, later.stamp]), np.concatenate([earlier.rows, later.rows])
    return Edge(earlier.parent, stamp[begin:], rows[begin:], static)


class _Part(NamedTuple):
    """Samples of one transform: rows of the messages (n,), parents' names, stamps (n,) and poses (n, 7)."""

    rows: IntArray
    parents: frozenset[str]
    stamp: IntArray
    poses: Array


def _parts(block: Block, path: str, times: IntArray | None) -> Iterator[tuple[str, _Part]]:
    """(child frame, samples) of one place in the list of transforms. times (n,) ns: in place of the headers' stamps."""
    stamp, valid = header_stamps(block, f"{path}.header")
    if times is not None:
        stamp, valid = times, np.ones(len(times), np.bool_)
    poses = block.numbers(block.paths(f"{path}.transform"))
    # ROS 1 writes names of frames with a leading slash as well.
    parents, children = (
        np.array([name.strip("/") for name in names])[number]
        for names, number in (block.text(f"{path}.{field}") for field in ("header.frame_id", "child_frame_id"))
    )
    for child in sorted(set(children[valid].tolist())):
        chosen = valid & (children == child)
        yield child, _Part(block.rows[chosen], frozenset(parents[chosen].tolist()), stamp[chosen], poses[chosen])


def _edge(child: str, parts: Sequence[_Part], static: bool) -> Edge:
    parents = sorted(frozenset[str]().union(*(part.parents for part in parts)))
    if len(parents) > 1:
        raise _several_parents(child, parents)
    order = np.argsort(np.concatenate([part.rows for part in parts]), kind="stable")
    stamp = np.concatenate([part.stamp for part in parts])[order]
    poses = normalised(np.concatenate([part.poses for part in parts])[order])
    return Edge(parents[0], stamp, poses, static)


def _several_parents(child: str, parents: Sequence[str]) -> TransformError:
    return TransformError(f"frame {child!r} has the parents {' and '.join(map(repr, parents))}, one is accepted")


def _at(edge: Edge, stamp: IntArray) -> Array:
    """The rows (n, 7) of an edge at stamps; NaN where it has none."""
    return np.tile(edge.rows[-1], (len(stamp), 1)) if edge.static else poses_at(stamp, edge.stamp, edge.rows)
