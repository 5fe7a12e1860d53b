# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What is repaired in a stream in order: poses continued or stale, jitter of stamps, a coarse resolution, low rate."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.windows.repairs.continued import ContinuedPoses
from push_predictor.recordings.windows.repairs.held import HeldPoses
from push_predictor.recordings.windows.repairs.regular_stamps import RegularStamps
from push_predictor.recordings.windows.repairs.resolution import Resolution, lengths
from push_predictor.recordings.windows.repairs.smoothing import SmoothedPoses
from push_predictor.recordings.windows.slow import SlowPoses
from push_predictor.recordings.windows.stamp_order import IsJump, OrderedSamples, with_values
from push_predictor.types import Array


class StreamRepairs:
    """Takes the samples of one stream in order and returns them repaired, as soon as they are decided.

    continued, held, smoothed, slow: None for a stream without a position. The result does not depend on the portions.
    """

    def __init__(self, is_jump: IsJump | None, angle: int | None) -> None:
        """is_jump: of poses whose first two columns are a position, m; None for other streams.

        angle: index of the column with a heading, rad, which is unwrapped; None without one.
        """
        self.regular = RegularStamps()
        self.continued = None if is_jump is None else ContinuedPoses(angle)
        self.held = None if is_jump is None else HeldPoses(angle)
        self.smoothed = None if is_jump is None else SmoothedPoses(angle)
        self.slow = None if is_jump is None else SlowPoses(is_jump, angle)
        self._resolution = Resolution(2 if angle is None else 3)
        self._angle = angle
        self._heading: Array = np.empty(0)  # the last one, rad

    @property
    def waiting(self) -> int:
        """How many samples wait."""
        return self.regular.waiting + sum(
            step.waiting for step in (self.continued, self.held, self.smoothed, self.slow) if step is not None
        )

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        if self.continued is None or self.held is None or self.smoothed is None or self.slow is None:
            return self.regular.take(new, final)
        values = self._unwrapped(new.values)
        # The repair of one must not hide the resolution from the next: they get it as a further column.
        quantum = np.max(self._resolution.take(lengths(values, self._angle)), axis=1, initial=0.0)
        new = with_values(new, np.column_stack([values, quantum]))
        for step in (self.continued, self.held, self.regular, self.smoothed, self.slow):
            new = step.take(new, final)
        return with_values(new, new.values[:, :-1])

    def _unwrapped(self, values: Array) -> Array:
        if self._angle is None or not len(values):
            return values
        values = values.copy()
        heading = np.unwrap(np.concatenate([self._heading, values[:, self._angle]]))
        values[:, self._angle], self._heading = heading[len(self._heading) :], heading[-1:]
        return values
