# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A recording in memory: the streams of tracker, robot and force sensor, each with its own stamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.fields.wrench_bias import WrenchBias
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array, BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class PoseStream:
    """n samples of a planar pose.

    Header stamps (n,) in ns; x, y, z (n,) in m; heading (n,) in rad, as measured. tilt (n,) in rad: between the
    body's z axis and the vertical; None where only headings are known.
    """

    stamp: IntArray
    x: Array
    y: Array
    z: Array
    heading: Array
    tilt: Array | None = None

    def __len__(self) -> int:
        return len(self.stamp)


@dataclass(frozen=True, eq=False)
class WrenchStream:
    """n samples of the wrench of the slider on the pusher.

    Header stamps (n,) in ns; fx, fy (n,) in N along the world's axes; torque (n,) in N m about the tip.
    """

    stamp: IntArray
    fx: Array
    fy: Array
    torque: Array

    def __len__(self) -> int:
        return len(self.stamp)


Stream = TypeVar("Stream", PoseStream, WrenchStream)


class _Dataclass(Protocol):
    __dataclass_fields__: ClassVar[dict[str, Any]]


Columns = TypeVar("Columns", bound=_Dataclass)  # of which each field is an array (n,) or None


def taken(stream: Columns, rows: Array | IntArray | BoolArray | slice) -> Columns:
    """The samples of a stream, or of another table of columns, at an index, a mask or a slice."""
    return replace(stream, **{name: of[rows] for name, of in vars(stream).items() if of is not None})


def joined(streams: Sequence[Columns]) -> Columns:
    """One stream or table of consecutive ones, at least one; what one of them lacks is lacking."""
    columns = {name: [getattr(stream, name) for stream in streams] for name in vars(streams[0])}
    whole: dict[str, Any] = {
        name: None if any(part is None for part in parts) else np.concatenate(parts) for name, parts in columns.items()
    }
    return replace(streams[0], **whole)


def repeated(stream: PoseStream | WrenchStream) -> BoolArray:
    """Which samples (n,) of a stream are in it before, with the same stamp and values."""
    again = np.zeros(len(stream), dtype=np.bool_)
    if np.all(np.diff(stream.stamp) > 0):
        return again
    order = np.argsort(stream.stamp, kind="stable")
    columns = [of[order] for of in vars(stream).values() if of is not None]
    again[order[1:]] = np.all([of[1:] == of[:-1] for of in columns], axis=0)
    return again


def set_back(before: PoseStream, after: PoseStream) -> bool:
    """Whether the clock was set back between two portions of a stream."""
    return len(before) > 0 and len(after) > 0 and int(before.stamp[-1]) - int(after.stamp[0]) > CLOCK_SET


@dataclass(frozen=True, eq=False)
class ScalarStream:
    """n samples of a scalar.

    stamp (n,) in ns: header stamp if the type has one, else log time; value (n,).
    """

    stamp: IntArray
    value: Array

    def __len__(self) -> int:
        return len(self.stamp)


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """All streams of one recording.

    name: stem of its file or folder. wrench: None without a force sensor. scalars: by topic name, the possible
    covariates. notes: sentences about what the reader discarded, repaired or assumed. wrench_bias: what was subtracted
    from the wrench, None if nothing was. losses: the notes about data that are missing or cannot be read.
    """

    name: str
    rig: Rig | None
    slider: PoseStream
    pusher: PoseStream
    wrench: WrenchStream | None
    scalars: dict[str, ScalarStream] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    wrench_bias: WrenchBias | None = None
    losses: tuple[str, ...] = ()

    @property
    def poses(self) -> dict[str, PoseStream]:
        """The streams of poses, by name."""
        return {"slider": self.slider, "pusher": self.pusher}

    @property
    def sensors(self) -> dict[str, PoseStream | WrenchStream]:
        """The streams of poses and that of the wrench, if there is one, by name."""
        return self.poses | ({} if self.wrench is None else {"wrench": self.wrench})

    def __repr__(self) -> str:
        seconds = 1e-9 * float(self.slider.stamp[-1] - self.slider.stamp[0]) if len(self.slider) else 0.0
        force = f"{len(self.wrench)} wrenches" if self.wrench is not None else "no force sensor"
        rig = f"{self.rig.shape} on {self.rig.surface}" if self.rig is not None else "no rig"
        return (
            f"Recording {self.name!r}: {rig}, {seconds:.1f} s\n"
            f"  {len(self.slider)} slider poses, {len(self.pusher)} pusher poses, {force}\n"
            f"  scalar topics: {', '.join(self.scalars) or 'none'}; notes: {len(self.notes)}"
        )
