"""A recording in memory: the streams of tracker, robot and force sensor, each with its own stamps."""

from __future__ import annotations

from dataclasses import dataclass, field

from push_predictor.recordings.rig import Rig
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class PoseStream:
    """n samples of a planar pose.

    Header stamps (n,) in ns; x, y, z (n,) in m; heading (n,) in rad, as measured.
    """

    stamp: IntArray
    x: Array
    y: Array
    z: Array
    heading: Array

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


@dataclass(frozen=True, eq=False)
class ScalarStream:
    """n samples of a scalar.

    stamp (n,) in ns: header stamp if the type has one, else log time; value (n,).
    """

    stamp: IntArray
    value: Array

    def __len__(self) -> int:
        return len(self.stamp)


@dataclass(frozen=True, eq=False)
class Recording:
    """All streams of one recording.

    name: stem of its file or folder. wrench: None without a force sensor. scalars: by topic name, the possible
    covariates. notes: sentences about what the reader discarded, repaired or assumed.
    """

    name: str
    rig: Rig | None
    slider: PoseStream
    pusher: PoseStream
    wrench: WrenchStream | None
    scalars: dict[str, ScalarStream] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
