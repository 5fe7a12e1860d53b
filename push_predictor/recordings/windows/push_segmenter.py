# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Segment the samples into pushes: contact, motion, and the intervals that become windows."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.streams import taken
from push_predictor.recordings.windows.contact import LONGEST_BREAK, ContactSamples
from push_predictor.recordings.windows.cut import PushContext
from push_predictor.recordings.windows.force import ForceTiming, ForceZero
from push_predictor.recordings.windows.push_window import TIMED_ID, WindowOptions
from push_predictor.types import BoolArray

FREE_GAP = 0.005  # m; farther away the pusher touches nothing, and its force is the sensor's zero
NOISE_FACTOR = 5.0  # standard deviations of the force in free motion
CLEAR = 3.0  # times the least force in contact: a smaller force shows a contact late
CLOSING_SHARE = 0.15  # of the tip's speed; a gap that shrinks or grows faster is no contact
LEAST_CLOSING_SPEED = 0.001  # m/s, below the noise of a tracker
INSIDE = 0.005  # m; a tip this deep inside the outline shows unsynchronised clocks or a wrong frame


def touches_nothing(samples: ContactSamples, options: WindowOptions) -> BoolArray:
    """Whether the tip (n,) is lifted or away from the outline, so that its force is the sensor's zero."""
    return np.asarray((samples.height > options.lift) | (samples.gap > FREE_GAP))


class PushSegmenter:
    """Takes contact samples in order and returns the windows that are complete: start and end in ns, and the push.

    counts: resets and samples inside the outline. push: the current push, None between pushes. start: that (ns) of the
    incomplete window, None without one. samples, touching: how many samples there were, and how many in contact.
    """

    def __init__(self, options: WindowOptions) -> None:
        self.options = options
        self._length = round(options.duration * 1e9)  # ns
        self._stride = round((options.stride or options.duration) * 1e9)
        self.counts = {"resets": 0, "inside": 0}
        self.push: PushContext | None = None
        self.samples = self.touching = 0
        self.timing = ForceTiming()
        self._zero = ForceZero()
        self.start: int | None = None
        self._last_good = -np.inf
        self._last_time: float | None = None
        self._idle = 0.0
        self._pushes = 0
        self._touching = self._shown = False
        self._inside = False
        self._first_touch: int | None = None
        self._last_contact: int | None = None

    def take(self, samples: ContactSamples) -> list[tuple[int, int, PushContext]]:
        """Add a portion of samples, at least one, and return the windows that end at or before the last of them."""
        options, known = self.options, samples.force_known
        lowered = samples.height <= options.lift
        inside = (samples.gap < -INSIDE) & lowered
        judged = lowered & ~(samples.in_break | inside)
        tared = self._zero.add(samples.force, known & ~samples.in_break & touches_nothing(samples, options))
        shown = self._shows_contact(samples, judged, ~known | tared)
        # A force that does not show contacts when the geometry does is not asked.
        apart = self._force_apart(samples, ~(samples.in_break | inside), shown, known & tared & ~samples.after_break)
        near = judged & known & (samples.gap <= options.touch_gap)
        touching = np.where(known & tared & ~apart, self._presses(samples, near & tared), shown)
        found = self._segment(samples, touching, inside, near, known & ~tared)
        self.samples += len(samples)
        return found

    # --- contact ------------------------------------------------------------------------------------------------

    def _shows_contact(self, samples: ContactSamples, judged: BoolArray, ends: BoolArray) -> BoolArray:
        """Whether the geometry shows a contact: the gap is small and does not shrink before it, nor grow after it.

        judged (n,): whether it can show one; ends (n,): whether a growing gap ends it.
        """
        limit = np.maximum(LEAST_CLOSING_SPEED, CLOSING_SHARE * samples.speed)
        near = judged & (samples.gap <= self.options.touch_gap_alone) & ~(ends & (samples.opening_speed > limit))
        sample = np.arange(len(samples))
        begun = np.maximum.accumulate(np.where(near & (samples.closing_speed <= limit), sample, -1))
        ended = np.maximum.accumulate(np.where(near, -2 if self._shown else -1, sample))
        shown = np.asarray(begun > ended)
        self._shown = bool(shown[-1])
        return shown

    def _force_apart(
        self, samples: ContactSamples, judged: BoolArray, shown: BoolArray, usable: BoolArray
    ) -> BoolArray:
        """Whether the force does not show contacts (n,), by the touches so far."""

        def clear_force(sample: int) -> float:
            """The force (N) that shows a contact without delay."""
            return max(CLEAR * self.options.least_force, NOISE_FACTOR * self._zero.at(int(rows[sample])).noise)

        rows, apart = np.flatnonzero(judged), np.zeros(len(samples), dtype=np.bool_)
        apart[rows] = self.timing.take(
            samples if len(rows) == len(samples) else taken(samples, rows),
            (shown & self._moves(samples))[rows],
            usable[rows],
            zero=lambda sample: self._zero.readings(int(rows[sample])),
            least_force=clear_force,
        )
        return apart

    def _moves(self, samples: ContactSamples) -> BoolArray:
        return np.asarray(samples.speed >= self.options.least_speed)

    def _presses(self, samples: ContactSamples, near: BoolArray) -> BoolArray:
        """At which samples (n,) of those near the slider the force shows a contact."""
        found, rows = np.zeros(len(samples), dtype=np.bool_), np.flatnonzero(near)
        size, noise = self._zero.above(samples.force, rows)
        found[rows] = size > np.maximum(self.options.least_force, NOISE_FACTOR * noise)
        return found

    def _at_rest(self, samples: ContactSamples, sample: int, near: bool, moves: bool) -> bool:
        """Whether a contact goes on at a sample before any free motion, where the force at rest is the zero."""
        if not moves and self.push is None:
            self._zero.rest(tuple(samples.force[sample].tolist()))
        # The force on a resting tip may be a preload: it can continue a contact but not show its begin or end.
        if not (near and self._touching) or self._zero.at(sample).mean is None:
            return False
        size, noise = self._zero.above(samples.force, np.array([sample]))
        return bool(size[0] > max(self.options.least_force, NOISE_FACTOR * noise[0]))

    # --- pushes and windows -------------------------------------------------------------------------------------

    def _segment(
        self, samples: ContactSamples, touching: BoolArray, inside: BoolArray, near: BoolArray, untared: BoolArray
    ) -> list[tuple[int, int, PushContext]]:
        """The windows in a portion with contacts (n,).

        near (n,): a force would show a contact; untared (n,): its zero in free motion is not known yet.
        """
        time, moves = samples.time, self._moves(samples)
        elapsed = np.diff(time, prepend=time[0] if self._last_time is None else self._last_time)
        entered = inside & ~samples.in_break
        self.counts["inside"] += int(np.sum(entered & ~np.append(self._inside, inside[:-1])))
        self.counts["resets"] += int(np.sum(samples.repositioned))
        self._inside, self._last_time = bool(inside[-1]), float(time[-1])
        ends = samples.repositioned | (samples.after_break & (elapsed > LONGEST_BREAK))
        stops, asks = samples.after_break | entered | ends, untared & ~samples.in_break
        idle = np.where(samples.after_break, 0.0, elapsed)
        columns = (samples.stamp, time, idle, stops, asks, touching, moves, samples.at_speed)
        done: list[tuple[int, int, PushContext]] = []
        for k, (stamp, at, step, stop, ask, touches, moving, at_speed) in enumerate(
            zip(*(column.tolist() for column in columns), strict=True)
        ):
            self._idle += step
            if stop:
                self.start = None
                if ends[k]:
                    self.push = self._first_touch = None
            if ask:
                touches = self._at_rest(samples, k, bool(near[k]), moving) or touches
            self._touching = touches
            self.touching += touches
            if touches and self._first_touch is None:
                self._first_touch = stamp
            if touches and moving:
                if self.push is None or self._idle > self.options.push_pause:
                    self._begin_push(stamp, self._zero.at(k).mean)
                self._idle, self._last_good, self._last_contact = 0.0, at, stamp
                if self.start is None and at_speed:
                    self.start = stamp
                if self.start is not None and self.start + self._length <= stamp:
                    done += self._complete(stamp)
            else:
                if at - self._last_good > self.options.bounce:
                    self.start = None
                if not touches and self._idle > self.options.push_pause:
                    self._first_touch = None
        return done

    def _complete(self, stamp: int) -> list[tuple[int, int, PushContext]]:
        """The windows of the push that end at or before a stamp (ns)."""
        done = []
        while self.push is not None and self.start is not None and self.start + self._length <= stamp:
            done.append((self.start, self.start + self._length, self.push))
            self.start += self._stride
        return done

    def _begin_push(self, stamp: int, tare: tuple[float, float] | None) -> None:
        first = self._first_touch if self._first_touch is not None else stamp
        if self.push is not None and first == self.push.first_touch:
            first = stamp  # the pusher rested in contact; this push begins with its motion
        dwell = (first - self._last_contact) * NANOSECOND if self._last_contact is not None else 0.0
        self.push = PushContext(_push_id(first), self._pushes, first, max(dwell, 0.0), tare)
        self._pushes += 1
        self.start = None


def _push_id(stamp: int) -> str:
    """The id from the time of first touch: a push gets the same id online, offline and in a copy."""
    return f"{TIMED_ID}{stamp // 10**9}.{stamp % 10**9 // 10**6:03d}"
