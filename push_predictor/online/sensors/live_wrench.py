# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""A live wrench as a recording gives it: along the world's axes, about the tip and without bias."""

from __future__ import annotations

from push_predictor.online.sensors.live_bias import LiveBias
from push_predictor.online.sensors.posed_wrench import PosedWrench, Wrenches
from push_predictor.online.sensors.transform_buffer import TransformBuffer
from push_predictor.recordings.fields.wrench_axes import at_tip
from push_predictor.recordings.fields.wrench_bias import LEAST_FREE
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.samples import pusher_stream, slider_stream, wrench_stream
from push_predictor.recordings.streams import WrenchStream
from push_predictor.recordings.topics import FREE_MOTION, WORLD_AXES, Topics
from push_predictor.types import Array, IntArray

UNKNOWN_BIAS = (
    f"The bias of the wrench is not known yet, so contact is found from geometry alone. Lift the tip, or move it away "
    f"from the slider, for {LEAST_FREE:g} s."
)


class LiveWrench:
    """Takes portions of wrench and poses, as `topics` state axes and bias of the wrench.

    transforms: with the sensor's frame as `turned`; needed where the axes are those of a frame in tf.
    """

    def __init__(self, topics: Topics, transforms: TransformBuffer | None = None) -> None:
        self._posed = None if topics.wrench_axes == WORLD_AXES else PosedWrench(transforms)
        self._bias = LiveBias() if topics.wrench_bias == FREE_MOTION else None

    def begin(self, rig: Rig) -> None:
        """Begin a run with a rig: the bias is estimated anew."""
        if self._bias is not None:
            self._bias.begin(rig)

    def put(
        self, wrench: tuple[IntArray, Array], slider: tuple[IntArray, Array], tip: tuple[IntArray, Array]
    ) -> WrenchStream:
        """The wrenches that are known with these portions: stamps (n,) ns and wrenches (n, 6) or poses (n, 7)."""
        found = Wrenches(*wrench) if self._posed is None else self._posed.put(*wrench, *tip)
        if self._bias is not None:
            found = self._bias.put(found, slider_stream(*slider), pusher_stream(*tip))
        if found.sensor is None or found.tip is None:
            return wrench_stream(found.stamp, found.values)
        return wrench_stream(found.stamp, at_tip(found.values, found.sensor, found.tip))

    @property
    def waits_for_bias(self) -> bool:
        """Whether wrenches are held back because their bias is not known."""
        return self._bias is not None and self._bias.waits

    @property
    def problems(self) -> list[str]:
        """What keeps the wrench from being used, in words."""
        if self._bias is None:
            return []
        if self._bias.estimate is not None and self._bias.problem:
            return [f"The bias of the wrench is kept as first estimated: {self._bias.problem}."]
        return [UNKNOWN_BIAS] if self._bias.waits else []

    def figures(self) -> dict[str, object]:
        """The estimate of the bias, and how many wrenches have no pose."""
        found: dict[str, object] = {}
        if self._posed is not None and self._posed.without_pose:
            found["wrench without pose"] = self._posed.without_pose
        if self._bias is not None:
            estimate, problem = self._bias.estimate, self._bias.problem
            pending = f"not known yet: {problem or 'too few samples'}"
            found["wrench bias"] = pending if estimate is None else estimate.to_text()
        return found
