# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A live wrench along the axes of the tip, turned into those of the world by the tip's pose at its stamp."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.fields.pose_rows import normalised, poses_at
from push_predictor.recordings.fields.wrench_axes import in_world_axes
from push_predictor.recordings.samples import has_orientation
from push_predictor.types import Array, IntArray

KEPT = 2_000_000_000  # ns of the tip's poses that are kept: streams lag by less
MOST_WAITING = 20_000  # wrenches that wait for the tip


class TurnedWrench:
    """Wrenches wait until a pose of the tip at or after their stamp is known. without_pose: how many got none."""

    def __init__(self) -> None:
        self.without_pose = 0
        self._stamp, self._values = np.empty(0, np.int64), np.empty((0, 6))
        self._tip_stamp, self._tip = np.empty(0, np.int64), np.empty((0, 7))

    def put(self, stamp: IntArray, values: Array, tip_stamp: IntArray, tip: Array) -> tuple[IntArray, Array]:
        """Stamps (n,) ns and wrenches (n, 6) along the world's axes that are known with these portions.

        stamp (w,), values (w, 6): new wrenches along the tip's axes. tip_stamp (t,), tip (t, 7): new poses of the tip.
        """
        self._note_tip(tip_stamp, tip)
        self._stamp = np.concatenate([self._stamp, stamp])[-MOST_WAITING:]
        self._values = np.concatenate([self._values, values])[-MOST_WAITING:]
        newest = self._tip_stamp[-1] if len(self._tip_stamp) else np.iinfo(np.int64).min
        due = self._stamp <= newest
        ready, wrenches = self._stamp[due], self._values[due]
        self._stamp, self._values = self._stamp[~due], self._values[~due]
        poses = poses_at(ready, self._tip_stamp, self._tip)
        known = ~np.isnan(poses).any(axis=1)
        self.without_pose += int(np.sum(~known))
        return ready[known], in_world_axes(wrenches[known], poses[known])

    def _note_tip(self, stamp: IntArray, poses: Array) -> None:
        oriented = has_orientation(poses)
        stamp, poses = stamp[oriented], poses[oriented]
        if not len(stamp):
            return
        if len(self._tip_stamp) and stamp[-1] < self._tip_stamp[-1]:  # the clock was set back: all that waits is old
            self.without_pose += len(self._stamp)
            self._stamp, self._values = self._stamp[:0], self._values[:0]
            self._tip_stamp, self._tip = self._tip_stamp[:0], self._tip[:0]
        self._tip_stamp = np.concatenate([self._tip_stamp, stamp])
        self._tip = np.concatenate([self._tip, normalised(poses)])
        kept = self._tip_stamp >= self._tip_stamp[-1] - KEPT
        self._tip_stamp, self._tip = self._tip_stamp[kept], self._tip[kept]
