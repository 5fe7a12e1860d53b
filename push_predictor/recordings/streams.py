"""A recording in memory: what a tracker, a robot and a force sensor delivered, each on its own clock ticks."""

from __future__ import annotations

from dataclasses import dataclass, field

from push_predictor.recordings.rig import Rig
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class PoseStream:
    """n samples of a planar pose: header stamps (n,) in ns; x, y, z (n,) in m; heading (n,) in rad, as measured."""

    stamp: IntArray
    x: Array
    y: Array
    z: Array
    heading: Array

    def __len__(self) -> int:
        return len(self.stamp)


@dataclass(frozen=True, eq=False)
class WrenchStream:
    """n samples of what the slider exerts on the pusher: header stamps (n,) in ns; fx, fy (n,) in N along the world's
    axes; torque (n,) in N m about the tip."""

    stamp: IntArray
    fx: Array
    fy: Array
    torque: Array

    def __len__(self) -> int:
        return len(self.stamp)


@dataclass(frozen=True, eq=False)
class ScalarStream:
    """n samples of a scalar: stamps (n,) in ns (header stamp where the type has one, else log time); value (n,)."""

    stamp: IntArray
    value: Array

    def __len__(self) -> int:
        return len(self.stamp)


@dataclass(frozen=True, eq=False)
class Recording:
    """All streams of one recording.

    name: stem of its file or folder. wrench is None where no sensor was recorded. scalars: by topic name, the
    possible covariates. notes: what the reader repaired, dropped or assumed, in words.
    """

    name: str
    rig: Rig | None
    slider: PoseStream
    pusher: PoseStream
    wrench: WrenchStream | None
    scalars: dict[str, ScalarStream] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
