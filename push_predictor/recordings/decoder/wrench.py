# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The wrench along the world's axes, about the tip and without bias, as the topics state."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from push_predictor.recordings.decoder.bias_so_far import BiasSoFar, Wrenches
from push_predictor.recordings.decoder.rules import (
    SPATIAL_WRENCH,
    WRENCH,
    has_orientation,
    pusher_stream,
    slider_stream,
    upright,
    wrench_stream,
)
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.fields.pose_rows import Z_UP, at_tip, normalised, poses_at, wrenches_z_up, z_up
from push_predictor.recordings.fields.sources import WRENCH_TARGET, Source
from push_predictor.recordings.fields.transforms import TransformError
from push_predictor.recordings.fields.wrench_bias import LEAST_FREE, WrenchBias
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import WrenchStream, joined
from push_predictor.recordings.topics import FREE_MOTION, WORLD_AXES, Topics
from push_predictor.types import Array, BoolArray, IntArray

UNKNOWN_BIAS = (
    f"The bias of the wrench is not known yet, so contact is found from geometry alone. Lift the tip, or move it away "
    f"from the slider, for {LEAST_FREE:g} s."
)


KEPT = 2_000_000_000  # ns of the tip's poses that are kept before the first wrench that waits: streams lag by less
MOST_WAITING = 20_000  # wrenches that wait, and poses of the tip for them
_NEVER = int(np.iinfo(np.int64).min)
# Of stamps (n,) ns, which are decided and the poses (k, 7) of the axes at these; the second: no more will come.
AxesAt: TypeAlias = Callable[[IntArray, bool], tuple[BoolArray, Array]]


class WrenchInput:
    """The wrench of a source. tf: has the sensor's frame, where the axes are those of a frame.

    messages: of the topic. expected: frame that headers must name, '' for any, if the axes are the world's, else they
    name the sensor's. world: of the poses, '' before it is known; named: frames that the poses' headers name.
    """

    def __init__(self, source: Source, topics: Topics, tf: TransformBuffer, expected: str) -> None:
        axes_of_world = topics.wrench_axes == WORLD_AXES
        self.messages = TopicInput(source, WRENCH_TARGET, expected if axes_of_world else "", topics.from_log)
        self._up, self._up_of_sensor = topics.up_of("wrench"), topics.up_of("pusher")
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
        planar = self._posed is None and self._up == Z_UP
        columns = self.messages.usable(WRENCH if planar else SPATIAL_WRENCH)
        if self._posed is not None:
            found = self._posed.put(columns.stamp, columns.values, *tip, last)
        else:
            found = Wrenches(columns.stamp, columns.values if planar else wrenches_z_up(columns.values, self._up))
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
            known, poses = self._tf.at(self.frame, self.turned_into, stamp, "wrench", last)
            self.problem = ""
        except TransformError as error:
            self.problem = str(error)
            return np.zeros(len(stamp), np.bool_), np.zeros((0, 7))
        return known, z_up(poses, self._up_of_sensor)

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


class PosedWrench:
    """Wrenches wait until poses of the tip and of the sensor at or after their stamp are known.

    Where the clock of the wrench is set back before that of the tip, the wrenches of the new time wait for the tip's.

    axes: the sensor's poses; None for a sensor with the axes of the tip. without_pose: how many wrenches got no pose;
    oriented: whether a pose of the tip had an orientation.
    """

    def __init__(self, axes: AxesAt | None = None) -> None:
        self.without_pose, self.oriented = 0, False
        self._axes = axes
        self._stamp, self._values = np.empty(0, np.int64), np.empty((0, 6))
        self._early, self._latest = np.empty(0, np.bool_), _NEVER  # whether of a time that the tip has not been set to
        self._tip_stamp, self._tip = np.empty(0, np.int64), np.empty((0, 7))

    def put(self, stamp: IntArray, values: Array, tip_stamp: IntArray, tip: Array, last: bool = False) -> Wrenches:
        """The wrenches whose poses are known with these portions; last: no more will come.

        stamp (w,), values (w, 6): new wrenches along the sensor's axes. tip_stamp (t,), tip (t, 7): new poses of the
        tip.
        """
        if len(jumps := np.flatnonzero(np.diff(tip_stamp) < -CLOCK_SET)):  # the wrenches before that are due first
            begin = int(jumps[0]) + 1
            before = self.put(stamp, values, tip_stamp[:begin], tip[:begin])
            return joined([before, self.put(stamp[:0], values[:0], tip_stamp[begin:], tip[begin:], last)])
        self._note_tip(tip_stamp, tip)
        self._stamp, self._values = np.concatenate([self._stamp, stamp]), np.concatenate([self._values, values])
        latest = np.maximum.accumulate(np.concatenate([[self._latest], stamp]))
        self._early, self._latest = np.concatenate([self._early, latest[1:] - stamp > CLOCK_SET]), int(latest[-1])
        newest = self._tip_stamp.max() if len(self._tip_stamp) else _NEVER
        due, sensor = self._sensor((self._stamp <= newest) & ~self._early | last, last)
        ready, wrenches = self._stamp[due], self._values[due]
        self._keep(np.flatnonzero(~due)[-MOST_WAITING:])
        poses = poses_at(ready, self._tip_stamp, self._tip)
        sensor = poses if sensor is None else sensor
        known = ~np.isnan(poses).any(axis=1) & ~np.isnan(sensor).any(axis=1)
        self.without_pose += int(np.sum(~known))
        self._forget()
        return Wrenches(ready[known], wrenches[known], sensor[known], poses[known])

    def _sensor(self, due: BoolArray, last: bool) -> tuple[BoolArray, Array | None]:
        """Which of the waiting wrenches are due by tf as well, and the sensor's poses at these; None for the tip's."""
        if self._axes is None:
            return due, None
        decided, rows = self._axes(self._stamp, last)
        return due & decided, rows[due[decided]]

    def _note_tip(self, stamp: IntArray, poses: Array) -> None:
        if self._axes is None:
            oriented = has_orientation(poses)
            self.oriented = self.oriented or bool(oriented.any())
            stamp, poses = stamp[oriented], normalised(poses[oriented])
        else:
            poses = upright(poses)  # tf has the orientation
        if not len(stamp):
            return
        if len(self._tip_stamp) and self._tip_stamp[-1] - stamp[-1] > CLOCK_SET:
            self.without_pose += int(np.sum(~self._early))
            self._keep(np.flatnonzero(self._early))
            self._early, self._latest = np.zeros_like(self._early), int(self._stamp.max(initial=_NEVER))
            self._tip_stamp, self._tip = self._tip_stamp[:0], self._tip[:0]
        self._tip_stamp = np.concatenate([self._tip_stamp, stamp])
        self._tip = np.concatenate([self._tip, poses])

    def _keep(self, rows: IntArray) -> None:
        """Let only these wrenches wait."""
        self._stamp, self._values, self._early = self._stamp[rows], self._values[rows], self._early[rows]

    def _forget(self) -> None:
        """Drop the tip's poses that no wrench needs, after those that came were used: the first portion may be long."""
        if len(self._tip_stamp):
            needed = min(int(self._tip_stamp[-1]), int(self._stamp.min(initial=np.iinfo(np.int64).max)))
            kept = np.flatnonzero(self._tip_stamp >= needed - KEPT)[-MOST_WAITING:]
            self._tip_stamp, self._tip = self._tip_stamp[kept], self._tip[kept]
