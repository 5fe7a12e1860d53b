# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The wrench along the world's axes, about the tip and without bias, as the topics state."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.decoder.bias_so_far import BiasSoFar
from push_predictor.recordings.decoder.posed_wrench import PosedWrench, Wrenches
from push_predictor.recordings.decoder.rules import (
    SPATIAL_WRENCH,
    WRENCH,
    pusher_stream,
    slider_stream,
    wrench_stream,
)
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.fields.sources import WRENCH_TARGET, Source
from push_predictor.recordings.fields.transforms import TransformError
from push_predictor.recordings.fields.wrench_axes import at_tip
from push_predictor.recordings.fields.wrench_bias import LEAST_FREE, WrenchBias
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import WrenchStream
from push_predictor.recordings.topics import FREE_MOTION, WORLD_AXES, Topics
from push_predictor.types import Array, BoolArray, IntArray

UNKNOWN_BIAS = (
    f"The bias of the wrench is not known yet, so contact is found from geometry alone. Lift the tip, or move it away "
    f"from the slider, for {LEAST_FREE:g} s."
)


class WrenchInput:
    """The wrench of a source. tf: has the sensor's frame, where the axes are those of a frame.

    messages: of the topic. expected: frame that headers must name, '' for any, if the axes are the world's, else they
    name the sensor's. world: of the poses, '' before it is known; named: frames that the poses' headers name.
    """

    def __init__(self, source: Source, topics: Topics, tf: TransformBuffer, expected: str) -> None:
        axes_of_world = topics.wrench_axes == WORLD_AXES
        self.messages = TopicInput(source, WRENCH_TARGET, expected if axes_of_world else "")
        self.problem = self.turned_into = ""  # why the axes are not turned; the frame into which they are
        self.frame = topics.wrench_tf_frame
        self.world, self.named = topics.world, frozenset[str]()
        self._tf = tf
        axes = self._axes_at if self.frame else None
        self._posed = None if axes_of_world else PosedWrench(axes)
        self.bias = BiasSoFar() if topics.wrench_bias == FREE_MOTION else None

    def begin(self, rig: Rig) -> None:
        """Begin a run with a rig: the bias is estimated anew."""
        if self.bias is not None:
            self.bias.begin(rig)

    def take(self, slider: tuple[IntArray, Array], tip: tuple[IntArray, Array], last: bool = False) -> WrenchStream:
        """The wrenches that are known with these new poses: stamps (n,) ns and poses (n, 7)."""
        columns = self.messages.usable(WRENCH if self._posed is None else SPATIAL_WRENCH)
        found = Wrenches(columns.stamp, columns.values)
        if self._posed is not None:
            found = self._posed.put(found.stamp, found.values, *tip, last)
        if self.bias is not None:
            found = self.bias.put(found, slider_stream(*slider), pusher_stream(*tip), last)
        if found.sensor is None or found.tip is None:
            return wrench_stream(found.stamp, found.values)
        return wrench_stream(found.stamp, at_tip(found.values, found.sensor, found.tip))

    def _axes_at(self, stamp: IntArray, last: bool) -> tuple[BoolArray, Array]:
        """See AxesAt: by tf, in the world as far as tf has it, else in the root above the frame."""
        tree = self._tf.tree()
        try:
            if not tree.edges:
                raise TransformError("no transform has been published")
            world = self.world or next((name for name in sorted(self.named) if name in tree.frames), "")
            self.turned_into = world or tree.root(self.frame)
            found = self._tf.at(self.frame, self.turned_into, stamp, "wrench", last)
            self.problem = ""
        except TransformError as error:
            self.problem = str(error)
            return np.zeros(len(stamp), np.bool_), np.zeros((0, 7))
        return found

    @property
    def without_pose(self) -> int:
        """How many wrenches got no pose of their axes or of the tip."""
        return 0 if self._posed is None else self._posed.without_pose

    @property
    def oriented(self) -> bool:
        """Whether a pose of the tip had an orientation, where the axes are those of the tip."""
        return self._posed is not None and self._posed.oriented

    @property
    def waits_for_bias(self) -> bool:
        """Whether wrenches are held back because their bias is not known."""
        return self.bias is not None and self.bias.waits

    @property
    def estimate(self) -> WrenchBias | None:
        """What is subtracted."""
        return None if self.bias is None else self.bias.estimate
