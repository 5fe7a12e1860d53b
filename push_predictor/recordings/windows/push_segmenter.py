# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Segment the samples into pushes: contact, motion, and the intervals that become windows."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.windows.contact import LONGEST_BREAK, ContactSample
from push_predictor.recordings.windows.cut import PushContext
from push_predictor.recordings.windows.force_timing import ForceTiming
from push_predictor.recordings.windows.push_window import TIMED_ID, WindowOptions

FREE_GAP = 0.005  # m; farther away the pusher touches nothing, and its force is the sensor's zero
TARE_SAMPLES = 30
NOISE_FACTOR = 5.0  # standard deviations of the force in free motion
CLEAR = 3.0  # times the least force in contact: a smaller force shows a contact late
CLOSING_SHARE = 0.15  # of the tip's speed; a gap that shrinks or grows faster is no contact
LEAST_CLOSING_SPEED = 0.001  # m/s, below the noise of a tracker
INSIDE = 0.005  # m; a tip this deep inside the outline shows unsynchronised clocks or a wrong frame


def touches_nothing(sample: ContactSample, options: WindowOptions) -> bool:
    """Whether the tip is lifted or away from the outline, so that its force is the sensor's zero."""
    return sample.height > options.lift or sample.gap > FREE_GAP


class PushSegmenter:
    """Takes contact samples in order and returns the windows that are complete: start and end in ns, and the push.

    counts: resets and samples inside the outline. push: the current push, None between pushes. samples, touching: how
    many samples there were, and how many of them in contact.
    """

    def __init__(self, options: WindowOptions) -> None:
        self.options = options
        self._length = round(options.duration * 1e9)  # ns
        self._stride = round((options.stride or options.duration) * 1e9)
        self.counts = {"resets": 0, "inside": 0}
        self.push: PushContext | None = None
        self.samples = self.touching = 0
        self.timing = ForceTiming()
        self._start: int | None = None  # of the incomplete window
        self._last_good = -np.inf
        self._last_time = -np.inf
        self._idle = 0.0
        self._pushes = 0
        self._free_force: deque[tuple[float, float]] = deque(maxlen=TARE_SAMPLES)
        self._resting_force: deque[tuple[float, float]] = deque(
            maxlen=TARE_SAMPLES
        )  # at rest near the slider, before a push
        self._zero: tuple[tuple[float, float] | None, float] | None = None  # of these forces; None after a new one
        self._touching = self._shown = False
        self._inside = False
        self._first_touch: int | None = None
        self._last_contact: int | None = None

    @property
    def start(self) -> int | None:
        """Start (ns) of the incomplete window, None without one."""
        return self._start

    def step(self, sample: ContactSample) -> list[tuple[int, int, PushContext]]:
        """Add one sample and return the windows that end at or before it."""
        self._update_breaks(sample)
        self._update_tare(sample)
        judged = not (sample.in_break or self._inside)
        self._shown = judged and self._shows_contact(sample)
        self._touching = touching = judged and self._touches(sample)
        self.samples += 1
        self.touching += touching
        if touching and self._first_touch is None:
            self._first_touch = sample.stamp
        if touching and sample.speed >= self.options.least_speed:
            return self._pushing(sample)
        self._not_pushing(sample, touching)
        return []

    def _update_breaks(self, sample: ContactSample) -> None:
        elapsed, self._last_time = sample.time - self._last_time, sample.time
        if sample.after_break:
            self._start = None
        else:
            self._idle += elapsed if math.isfinite(elapsed) else 0.0
        if (inside := sample.gap < -INSIDE and sample.height <= self.options.lift) and not sample.in_break:
            self.counts["inside"] += not self._inside
            self._start = None
        self._inside = inside
        if sample.repositioned or (sample.after_break and elapsed > LONGEST_BREAK):
            self.counts["resets"] += sample.repositioned
            self._end_push()

    def _update_tare(self, sample: ContactSample) -> None:
        if sample.force is None or sample.in_break:
            return
        if touches_nothing(sample, self.options):
            self._free_force.append(sample.force)
            self._zero = None
        elif sample.speed < self.options.least_speed and self.push is None:
            self._resting_force.append(sample.force)
            self._zero = None

    def _touches(self, sample: ContactSample) -> bool:
        pushing = self._shown and sample.speed >= self.options.least_speed
        self.timing.add(sample, pushing, self._free_force, self._clear_force)
        if sample.height > self.options.lift:
            return False
        pressed = sample.gap <= self.options.touch_gap and self._presses(sample.force)
        if self.timing.apart:
            return self._shown
        if sample.force is not None and self._free_force:
            return pressed
        # The force on a resting tip may be a preload: it can continue a contact but not show its begin or end.
        return self._shown or (self._touching and pressed)

    def _shows_contact(self, sample: ContactSample) -> bool:
        """Whether the geometry shows a contact: the gap is small and does not shrink before it, nor grow after it."""
        if sample.height > self.options.lift or sample.gap > self.options.touch_gap_alone:
            return False
        limit = max(LEAST_CLOSING_SPEED, CLOSING_SHARE * sample.speed)
        separates = sample.opening_speed > limit and (sample.force is None or bool(self._free_force))
        return not separates and (self._shown or sample.closing_speed <= limit)

    def _presses(self, force: tuple[float, float] | None) -> bool:
        zero, _ = self._tare()
        if force is None or zero is None:
            return False
        return math.hypot(force[0] - zero[0], force[1] - zero[1]) > self._least_force()

    def _least_force(self) -> float:
        """The force (N) above which there is contact."""
        return max(self.options.least_force, NOISE_FACTOR * self._tare()[1])

    def _clear_force(self) -> float:
        """The force (N) that shows a contact without delay."""
        return max(CLEAR * self.options.least_force, self._least_force())

    def _tare(self) -> tuple[tuple[float, float] | None, float]:
        """Mean force and its noise (N) in free motion; before any, at rest near the slider; else None."""
        if self._zero is None:
            readings = np.array(self._free_force or self._resting_force)
            x, y = readings.mean(axis=0).tolist() if len(readings) else (0.0, 0.0)
            noise = float(np.hypot(*readings.std(axis=0))) if len(readings) else 0.0
            self._zero = (x, y) if len(readings) else None, noise
        return self._zero

    def _pushing(self, sample: ContactSample) -> list[tuple[int, int, PushContext]]:
        push = self.push
        if push is None or self._idle > self.options.push_pause:
            push = self._begin_push(sample)
        self._idle = 0.0
        self._last_good, self._last_contact = sample.time, sample.stamp
        if self._start is None and sample.at_speed:
            self._start = sample.stamp
        done = []
        while self._start is not None and self._start + self._length <= sample.stamp:
            done.append((self._start, self._start + self._length, push))
            self._start += self._stride
        return done

    def _not_pushing(self, sample: ContactSample, touching: bool) -> None:
        if sample.time - self._last_good > self.options.bounce:
            self._start = None
        if not touching and self._idle > self.options.push_pause:
            self._first_touch = None

    def _begin_push(self, sample: ContactSample) -> PushContext:
        first = self._first_touch if self._first_touch is not None else sample.stamp
        if self.push is not None and first == self.push.first_touch:
            first = sample.stamp  # the pusher rested in contact; this push begins with its motion
        dwell = (first - self._last_contact) * NANOSECOND if self._last_contact is not None else 0.0
        self.push = PushContext(_push_id(first), self._pushes, first, max(dwell, 0.0), self._tare()[0])
        self._pushes += 1
        self._start = None
        return self.push

    def _end_push(self) -> None:
        self.push, self._start, self._first_touch = None, None, None


def _push_id(stamp: int) -> str:
    """The id from the time of first touch: a push gets the same id online, offline and in a copy."""
    return f"{TIMED_ID}{stamp // 10**9}.{stamp % 10**9 // 10**6:03d}"
