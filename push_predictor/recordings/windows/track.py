# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One stream while samples arrive: stamp order, repairs, dropouts, jumps, interpolation."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.dropouts import NANOSECOND, longest_interval
from push_predictor.recordings.windows.regular_stamps import RegularStamps
from push_predictor.recordings.windows.resolution import Resolution, SmoothedPoses, lengths
from push_predictor.recordings.windows.slow import SlowPoses
from push_predictor.recordings.windows.stamp_order import IsJump, OrderedSamples, Portions, StampOrder
from push_predictor.recordings.windows.unmeasured import ContinuedPoses, HeldPoses
from push_predictor.types import Array, BoolArray, IntArray

PERIOD_SAMPLES = 50  # intervals that determine the period: the first ones, so that later samples do not change it
JUMP_DISTANCE, JUMP_SPEED = 0.005, 1.5  # m, m/s: a change above distance + speed * time is no motion
JUMP_ANGLE, JUMP_TURN_RATE = 0.1, 8.0  # rad, rad/s: the same for the heading


class Track:
    """The samples of one stream.

    stamp (n,) ns: header stamps; time (n,) s after an origin (ns); values (n, width). position: the first two columns
    are a position, m, in which jumps are detected. angle: index of a column with an angle, which is unwrapped. counts:
    discarded samples by kind, see StampOrder; jumps also counts those after which the stream continues at the new
    position. interrupted (n,): data between the previous sample and this are missing.
    """

    def __init__(self, width: int, position: bool = False, angle: int | None = None) -> None:
        self.stamp: IntArray = np.empty(0, dtype=np.int64)
        self.time: Array = np.empty(0)
        self.values: Array = np.empty((0, width))
        self.interrupted: BoolArray = np.empty(0, dtype=np.bool_)
        self.order = StampOrder(width, self.is_jump if position else None)
        self.repairs = StreamRepairs(self.is_jump if position else None, angle)
        self.jumps = 0
        self._angle = angle
        self._period: float | None = None

    def __len__(self) -> int:
        return len(self.stamp)

    @property
    def counts(self) -> Counter[str]:
        """Discarded samples and jumps, by kind."""
        return self.order.counts + Counter(jumps=self.jumps)

    @property
    def empty(self) -> bool:
        """Whether no sample has arrived, not even an undecided one."""
        return not len(self) and not len(self.order.waiting[0]) and not self.repairs.waiting

    def extend(self, new: OrderedSamples, origin: int) -> None:
        """Append samples that `order` accepted, as `repairs` returned them."""
        values, first = new.values, min(len(self), 1)
        times = (np.concatenate([self.stamp[-1:], new.stamp]) - origin) * NANOSECOND
        jumps = np.zeros(len(values), dtype=np.bool_)
        if self.order.is_jump is not None:
            joined = np.concatenate([self.values[-1:], values])
            jumps[1 - first :] = self.order.is_jump(joined[:-1], joined[1:], np.diff(times))
        self.jumps += int(np.sum(jumps))
        self.stamp = np.concatenate([self.stamp, new.stamp])
        self.time = np.concatenate([self.time, times[first:]])
        self.values = np.concatenate([self.values, values])
        self.interrupted = np.concatenate([self.interrupted, new.interrupted | jumps])

    def forget_before(self, time: float) -> None:
        """Remove the samples before `time`, except the last of them."""
        keep = max(0, int(np.searchsorted(self.time, time)) - 1)
        if self._period is not None:
            self.stamp, self.time = self.stamp[keep:], self.time[keep:]
            self.values, self.interrupted = self.values[keep:], self.interrupted[keep:]

    def at(self, time: Array) -> Array:
        """Values (m, width) at times (m,), linear between samples and constant beyond them."""
        around = slice(None)
        if len(time):  # few of a day's samples: from the last at or before the times to the first at or after them
            begin = int(np.searchsorted(self.time, time.min(), side="right")) - 1
            around = slice(max(begin, 0), int(np.searchsorted(self.time, time.max())) + 1)
        known = self.time[around]
        return np.column_stack([np.interp(time, known, column) for column in self.values[around].T])

    def period_known(self, final: bool) -> bool:
        """Whether the period is known, so that dropouts can be detected.

        With `final` any number of samples will do.
        """
        if self._period is None and (final or len(self) > PERIOD_SAMPLES):
            self._period = float(np.median(np.diff(self.time[: PERIOD_SAMPLES + 1]))) if len(self) > 1 else 0.0
        return self._period is not None

    @property
    def period(self) -> float:
        """Median interval of the first samples, s; 0 until it is known."""
        return self._period or 0.0

    @property
    def resolution(self) -> float:
        """The step (m) in which positions were written, 0 if it is fine."""
        return self.repairs.smoothed.resolution

    def breaks_in(self, start: Array, end: Array) -> tuple[BoolArray, BoolArray]:
        """For intervals (start, end] (m,): does a break overlap each, and does one extend beyond its end?

        A break is a dropout or a jump.
        """
        begins, ends = self._breaks()  # in order and disjoint, so the last that begins before `end` decides
        last = np.searchsorted(begins, end, side="left") - 1
        return ends[last] > start, ends[last] > end

    def dropouts(self, start: float, end: float) -> int:
        """Number of dropouts that end within (start, end] (s)."""
        ends = self.time[1:][np.diff(self.time) > self.longest_gap]
        return int(np.sum((ends > start) & (ends <= end)))

    @property
    def longest_gap(self) -> float:
        """The longest interval (s) between two samples that is not a dropout."""
        return longest_interval(self.period)

    def _breaks(self) -> tuple[Array, Array]:
        """Starts (k,) and ends (k,) of breaks, including the time before the first and after the last sample."""
        gaps = np.flatnonzero((np.diff(self.time) > self.longest_gap) | self.interrupted[1:])
        begins = np.concatenate([[-np.inf], self.time[gaps], [self.time[-1] + self.longest_gap]])
        return begins, np.concatenate([[self.time[0]], self.time[gaps + 1], [np.inf]])

    def is_jump(self, before: Array, after: Array, elapsed: Array) -> BoolArray:
        """Whether no motion leads from one pose (n, width) to another (n, width) within a time (n,) s."""
        step = after - before
        jump = np.hypot(step[:, 0], step[:, 1]) > JUMP_DISTANCE + JUMP_SPEED * elapsed
        if self._angle is not None:
            jump = jump | (np.abs(wrap_angle(step[:, self._angle])) > JUMP_ANGLE + JUMP_TURN_RATE * elapsed)
        return np.asarray(jump)


# --- repairs of a stream in order: poses not measured, jitter of stamps, a coarse resolution, a low rate --------------


class StreamRepairs:
    """Takes the samples of one stream in order and returns them repaired, as soon as they are decided.

    regular, smoothed: the steps that replace stamps, and poses of a coarse resolution. The result does not depend on
    the portions.
    """

    def __init__(self, is_jump: IsJump | None, angle: int | None) -> None:
        """is_jump: of poses whose first two columns are a position, m; None for other streams.

        angle: index of the column with a heading, rad, which is unwrapped; None without one.
        """
        self.regular = RegularStamps()
        self.smoothed = SmoothedPoses(angle)
        self._steps: list[Portions] = [self.regular]
        if is_jump is not None:
            before, after = [ContinuedPoses(angle), HeldPoses(angle)], [self.smoothed, SlowPoses(is_jump, angle)]
            self._steps = [*before, self.regular, *after]
        self._resolution = Resolution(2 if angle is None else 3)
        self._angle = angle
        self._heading: Array = np.empty(0)  # the last one, rad

    @property
    def waiting(self) -> int:
        """How many samples wait."""
        return sum(step.waiting for step in self._steps)

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        if len(self._steps) == 1:
            return self.regular.take(new, final)
        values = self._unwrapped(new.values)
        # The repair of one must not hide the resolution from the next: they get it as a further column.
        quantum = np.max(self._resolution.take(lengths(values, self._angle)), axis=1, initial=0.0)
        new = replace(new, values=np.column_stack([values, quantum]))
        for step in self._steps:
            new = step.take(new, final)
        return replace(new, values=new.values[:, :-1])

    def _unwrapped(self, values: Array) -> Array:
        if self._angle is None or not len(values):
            return values
        values = values.copy()
        heading = np.unwrap(np.concatenate([self._heading, values[:, self._angle]]))
        values[:, self._angle], self._heading = heading[len(self._heading) :], heading[-1:]
        return values
