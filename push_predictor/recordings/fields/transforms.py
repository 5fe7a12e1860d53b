"""The tree of frames in /tf and /tf_static, and the pose of one frame in another over time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from push_predictor.recordings.fields.columns import Block, blocks
from push_predictor.recordings.fields.message_text import STANDARD
from push_predictor.recordings.fields.pose_rows import composed, interpolated, inverted, normalised
from push_predictor.recordings.fields.sources import header_stamps
from push_predictor.recordings.windows.track import DROPOUT_PERIODS, NANOSECOND, SHORTEST_DROPOUT
from push_predictor.types import Array, BoolArray, IntArray

WORLD = "world"
_NUMBERS = 9  # of a transform: two of its stamp, three of its translation, four of its rotation


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
    """A frame has no pose; the message states why and which frames there are."""


@dataclass(frozen=True, eq=False)
class TransformTree:
    """The edges of a tree of frames, by child frame; unreadable counts the messages that are not in it."""

    edges: dict[str, Edge]
    unreadable: int = 0

    @property
    def frames(self) -> list[str]:
        """The names of all frames."""
        return sorted({*self.edges, *(edge.parent for edge in self.edges.values())})

    def root(self, frame: str) -> str:
        """The frame `world` if the frame descends from it, else the root of its tree. Raises TransformError."""
        above = self._ancestors(frame)
        return WORLD if WORLD in above else above[-1]

    def poses(self, frame: str, world: str) -> tuple[IntArray, Array, int]:
        """Stamps (n,) in ns and rows (n, 7) of a frame in another, and the number of stamps without a pose.

        Stamps are those of the edge with the most samples, in file order. The other edges are interpolated there; a
        stamp outside an edge's time, or in a dropout of it, has no pose. Raises TransformError.
        """
        up, down = self._chain(frame, world)
        moving = [self.edges[name] for name in (*up, *down) if not self.edges[name].static]
        if not moving:
            raise TransformError(f"frame {frame!r} never moves in {world!r}: all its transforms are static")
        finest = max(moving, key=lambda edge: len(edge.stamp))
        inside = np.ones(len(finest.stamp), dtype=np.bool_)
        for edge in moving:
            inside &= edge is finest or _covered(edge, finest.stamp)
        stamp = finest.stamp[inside]
        found = self._along(up, stamp, finest, inside)
        if down:
            found = composed(inverted(self._along(down, stamp, finest, inside)), found)
        return stamp, found, len(finest.stamp) - len(stamp)

    def _along(self, names: Sequence[str], stamp: IntArray, finest: Edge, inside: BoolArray) -> Array:
        """The pose (n, 7) of the first frame in the parent of the last."""
        found = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(stamp), 1))
        for name in names:
            edge = self.edges[name]
            rows = edge.rows[inside] if edge is finest else _at(edge, stamp)
            found = composed(rows, found)
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
            raise TransformError(f"no frame {frame!r}; the frames are {', '.join(self.frames) or 'none'}")
        found = [frame]
        while (edge := self.edges.get(found[-1])) is not None:
            if edge.parent in found:
                raise TransformError(f"frame {frame!r} is its own ancestor: {' in '.join([*found, edge.parent])}")
            found.append(edge.parent)
        return found


def read_tree(recorded: Sequence[tuple[Sequence[bytes], str, bool]]) -> TransformTree:
    """The tree in messages of tf topics, each with its message type and whether it is the static topic.

    Raises TransformError for a frame with two parents.
    """
    found: dict[str, list[_Part]] = {}
    unreadable = 0
    for messages, type_name, static in recorded:
        read = 0
        for block in blocks(messages, type_name, STANDARD, ["transforms"]):
            read += len(block.rows)
            for number in range(len(block.paths("transforms")) // _NUMBERS):
                for child, part in _parts(block, f"transforms[{number}]", static):
                    found.setdefault(child, []).append(part)
        unreadable += len(messages) - read
    return TransformTree({child: _edge(child, parts) for child, parts in found.items()}, unreadable)


class _Part(NamedTuple):
    """Samples of one transform: rows of the messages (n,), parents' names, stamps (n,) and poses (n, 7)."""

    rows: IntArray
    parents: frozenset[str]
    stamp: IntArray
    poses: Array
    static: bool


def _parts(block: Block, path: str, static: bool) -> Iterator[tuple[str, _Part]]:
    """(child frame, samples) of one place in the list of transforms."""
    stamp, valid = header_stamps(block, f"{path}.header")
    poses = np.stack([block.number(name) for name in block.paths(f"{path}.transform")], axis=1)
    # ROS 1 writes names of frames with a leading slash as well.
    parents, children = (
        np.array([name.strip("/") for name in block.text(f"{path}.{field}")])
        for field in ("header.frame_id", "child_frame_id")
    )
    for child in sorted(set(children[valid].tolist())):
        chosen = valid & (children == child)
        yield (
            child,
            _Part(block.rows[chosen], frozenset(parents[chosen].tolist()), stamp[chosen], poses[chosen], static),
        )


def _edge(child: str, parts: Sequence[_Part]) -> Edge:
    parents = sorted(frozenset[str]().union(*(part.parents for part in parts)))
    if len(parents) > 1:
        raise TransformError(f"frame {child!r} has the parents {' and '.join(map(repr, parents))}, one is accepted")
    order = np.argsort(np.concatenate([part.rows for part in parts]), kind="stable")
    stamp = np.concatenate([part.stamp for part in parts])[order]
    poses = normalised(np.concatenate([part.poses for part in parts])[order])
    return Edge(parents[0], stamp, poses, all(part.static for part in parts))


def _sorted(edge: Edge) -> tuple[IntArray, Array]:
    """Stamps in order, each once, and their rows."""
    stamp, first = np.unique(edge.stamp, return_index=True)
    return stamp, edge.rows[first]


def _covered(edge: Edge, stamp: IntArray) -> BoolArray:
    """Which stamps (n,) lie between two samples of an edge that are not a dropout apart."""
    known, _ = _sorted(edge)
    after = np.clip(np.searchsorted(known, stamp), 1, max(len(known) - 1, 1))
    if len(known) < 2:
        return np.asarray(stamp == known[0])
    gap = np.diff(known) * NANOSECOND
    longest = max(SHORTEST_DROPOUT, DROPOUT_PERIODS * float(np.median(gap)))
    within = (stamp >= known[0]) & (stamp <= known[-1])
    return np.asarray(within & ((gap[after - 1] <= longest) | (stamp == known[after]) | (stamp == known[after - 1])))


def _at(edge: Edge, stamp: IntArray) -> Array:
    """The rows (n, 7) of an edge at stamps that it covers."""
    if edge.static:
        return np.tile(edge.rows[-1], (len(stamp), 1))
    known, rows = _sorted(edge)
    if len(known) < 2:
        return np.tile(rows[0], (len(stamp), 1))
    after = np.clip(np.searchsorted(known, stamp), 1, len(known) - 1)
    share = (stamp - known[after - 1]) / (known[after] - known[after - 1])
    return interpolated(rows[after - 1], rows[after], np.asarray(share, dtype=np.float64))
