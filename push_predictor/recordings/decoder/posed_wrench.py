# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A wrench with the poses of its axes and of the tip at its stamps: from the tip's poses, or from tf."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.recordings.decoder.rules import has_orientation, upright
from push_predictor.recordings.fields.pose_rows import normalised, poses_at
from push_predictor.recordings.windows.clock_set import CLOCK_SET
from push_predictor.types import Array, BoolArray, IntArray

KEPT = 2_000_000_000  # ns of the tip's poses that are kept before the first wrench that waits: streams lag by less
MOST_WAITING = 20_000  # wrenches that wait, and poses of the tip for them
# Of stamps (n,) ns, which are decided and the poses (k, 7) of the axes at these; the second: no more will come.
_NEVER = int(np.iinfo(np.int64).min)
AxesAt: TypeAlias = Callable[[IntArray, bool], tuple[BoolArray, Array]]


class Wrenches(NamedTuple):
    """Stamps (n,) ns and wrenches (n, 6) along the axes of a sensor, with its poses and the tip's (n, 7) in the world.

    sensor and tip are None where the axes are the world's.
    """

    stamp: IntArray
    values: Array
    sensor: Array | None = None
    tip: Array | None = None


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
