# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whether the force shows contacts when the geometry does: how late it rises at each first touch.

A force that is filtered, late, early, rare, faint, constant or that of another time shifts every window that it begins
and ends. Where slider and tip show first touches themselves, the pushes so far decide whether the force may.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from push_predictor.recordings.streams import joined, taken
from push_predictor.recordings.windows.contact import NEAR, ContactSamples
from push_predictor.types import Array, BoolArray, IntArray

SEARCHED = 0.5  # s before and after a touch in which its force is looked for
PAUSE = 0.1  # s without contact before a touch
HIGH = 0.4  # of the samples of a contact have a larger force than that which is taken for it
SHARE = 0.5  # of the force in contact, at which it is said to rise: a filter delays this point by its delay
RESTED = 0.0005  # m that the slider moves at most in PAUSE before a touch: it begins no motion otherwise
CARRIED = 0.001  # m that the slider moves after a touch: a tip that only passes it pushes nothing
STEADY = 0.2  # s after a touch in which the gap is that of a contact
TOGETHER = 0.001  # m, the gap in a contact
GAP_NOISE = 0.0002  # m, standard deviation of the gap with which it shows a touch
RECENT = 30  # touches that decide whether the force may, besides all: a clock may be set
FEWEST = 5  # touches
UNSEEN = 3  # touches in a row that the force does not show
MISSING = 0.2  # share of the touches that the force does not show
LATEST = 0.005  # s: half a period of a usual tracker
EARLIEST = 0.020  # s: a rod bends before the slider moves
DOUBT = 4.0  # standard deviations; the pushes are judged one after the other
SAMPLING = 0.006  # s, standard deviation of the delay at one touch, by the sampling of tracker and force
SPREAD = 1.2533 * 1.4826  # from the median absolute deviation to the sd of a median, times the root of the number
TARE_SAMPLES = 30


class ForceDelay(NamedTuple):
    """How late the force rises, s: the median over touches and its standard deviation.

    touches: how many there were; missing: the share of them that the force does not show.
    """

    value: float
    sd: float
    touches: int
    missing: float

    @property
    def apart(self) -> bool:
        """Whether the force clearly rises before or after the touch, or not at all."""
        if self.touches < FEWEST:
            return False
        error = np.sqrt(self.missing * (1.0 - self.missing) / self.touches)
        return bool(self.shifted or self.missing - error > MISSING)

    @property
    def shifted(self) -> bool:
        """Whether it clearly rises before or after the touch."""
        late, early = self.value - DOUBT * self.sd > LATEST, self.value + DOUBT * self.sd < -EARLIEST
        return self.touches >= FEWEST and (late or early)


def force_delay(delays: Sequence[float]) -> ForceDelay:
    """The delay from those at touches, s; NaN for a touch that the force does not show."""
    values = np.asarray(delays, dtype=np.float64)
    known = values[np.isfinite(values)]
    missing = 1.0 - len(known) / len(values) if len(values) else 0.0
    if not len(known):
        return ForceDelay(0.0, np.inf, len(values), missing)
    middle = float(_median(known))
    spread = max(SPREAD * float(_median(np.abs(known - middle))), SAMPLING)
    return ForceDelay(middle, float(spread / np.sqrt(len(known))), len(values), missing)


class ForceTiming:
    """Takes the samples in order, in portions.

    touches: time (s) of each touch so far, and the delay of the force (s), NaN where it does not show the contact.
    """

    def __init__(self) -> None:
        self.touches: list[tuple[float, float]] = []
        self.apart = False
        self._samples: ContactSamples | None = None  # of the last SEARCHED, and since a touch that is not judged yet
        self._touch: int | None = None  # its index in these
        self._last_contact = -np.inf

    def take(
        self,
        samples: ContactSamples,
        contact: BoolArray,
        usable: BoolArray,
        zero: Callable[[int], Array],
        least_force: Callable[[int], float],
    ) -> BoolArray:
        """Add n samples and return whether the force is apart at each, by the touches judged up to it.

        contact (n,): whether the geometry shows one, and the tip moves; usable (n,): whether the force and its zero are
        known without a break since the sample before. Asked at the sample at which a touch is judged: zero, the
        readings (m, 2) N without contact, and least_force, N: a smaller one does not show a contact.
        """
        apart = np.full(len(samples), self.apart)
        touches = self._candidates(samples.time, contact, usable)
        known = samples if self._samples is None else joined([self._samples, samples])
        first = len(known) - len(samples)
        unusable = first + np.flatnonzero(~usable)
        waiting = [] if self._touch is None else [self._touch]
        begin, self._touch = 0, None  # of the samples that are not searched yet
        for touch in [*waiting, *(first + touches).tolist()]:
            if touch < begin:  # within the time that is searched for another
                continue
            end = int(np.searchsorted(known.time, known.time[touch] + SEARCHED, side="right"))
            broken = int(np.searchsorted(unusable, touch))
            if broken < len(unusable) and unusable[broken] <= end:
                continue
            if end == len(known):
                self._touch = touch
                break
            begin = end + 1
            since = max(_begin(known.time, touch), int(unusable[broken - 1]) + 1 if broken else 0)
            around, at = taken(known, slice(since, end + 1)), end - first
            self._judge(around, touch - since, zero(at), least_force(at))
            apart[at:] = self.apart
        self._keep(known, int(unusable[-1]) + 1 if len(unusable) else 0)
        return apart

    def _candidates(self, time: Array, contact: BoolArray, usable: BoolArray) -> IntArray:
        """Samples at which a contact begins after PAUSE without one, and without a break."""
        times = np.where(contact | ~usable, time, -np.inf)
        last = np.maximum.accumulate(np.append(self._last_contact, times))
        self._last_contact = float(last[-1])
        return np.flatnonzero(usable & contact & (time - last[:-1] > PAUSE))

    def _keep(self, known: ContactSamples, usable: int) -> None:
        """Keep the samples that the next touch, or the one that waits, needs."""
        if not len(known):
            return
        since = max(_begin(known.time, len(known) - 1 if self._touch is None else self._touch), usable)
        self._samples = taken(known, slice(since, None))
        self._touch = None if self._touch is None else self._touch - since

    def _judge(self, samples: ContactSamples, touch: int, zero: Array, least_force: float) -> None:
        """Judge a touch, the index of one of the samples around it. zero: readings (m, 2) N without contact."""
        time, place = samples.time, samples.place
        before = int(np.searchsorted(time, time[touch] - PAUSE))
        rested = math.dist(place[before], place[touch]) < RESTED
        if not rested or math.dist(place[touch], place[-1]) < CARRIED or not _exact(time, samples.gap, touch):
            return
        x, y = (samples.force - _median(zero)).T
        # The last of the approach, at which the gap still shrinks by as much.
        approach = NEAR * max(float(samples.closing_speed[touch]), 0.0) / float(samples.speed[touch])
        share = 0.5 * min((_parted(time, samples.gap, touch) - time[touch]) / SEARCHED, 1.0)
        begin = time[touch] + approach
        # If the slider's poses are late, the tip enters the outline before the slider starts: tip and force agree then.
        reached = min(_reached(time, samples.gap, touch) - begin, 0.0)
        delay = _delay(time - begin, np.hypot(x, y), 1.0 - HIGH * share, reached, least_force)
        self.touches.append((float(time[touch]), delay))
        delays = [delay for _, delay in self.touches]
        unseen = len(delays) >= UNSEEN and all(map(math.isnan, delays[-UNSEEN:]))
        self.apart = unseen or any(force_delay(delays[-last:]).apart for last in (0, RECENT))


def _begin(time: Array, sample: int) -> int:
    """The first sample within SEARCHED before one."""
    return int(np.searchsorted(time, time[sample] - SEARCHED))


def _exact(time: Array, gap: Array, touch: int) -> bool:
    """Whether the gap shows the touch exactly: it has little noise after it, and samples close to each other."""
    after = slice(touch, int(np.searchsorted(time, time[touch] + STEADY, side="right")))
    noise = float((gap[after][1:] - gap[after][:-1]).std()) / math.sqrt(2.0)
    return noise < GAP_NOISE and float((time[after][1:] - time[after][:-1]).max()) <= NEAR


def _parted(time: Array, gap: Array, touch: int) -> float:
    """When (s) tip and slider part after a touch; the last time if they stay together."""
    apart = np.flatnonzero(gap[touch:] > TOGETHER)
    return float(time[touch + apart[0]] if len(apart) else time[-1])


def _reached(time: Array, gap: Array, touch: int) -> float:
    """When (s) the tip reached the outline before a touch, where it is inside at the touch; else at the touch."""
    outside = np.flatnonzero(gap[: touch + 1] > 0.0)
    if not len(outside) or outside[-1] == touch:
        return float(time[touch])
    last = int(outside[-1])
    return float(time[last] + (time[last + 1] - time[last]) * gap[last] / (gap[last] - gap[last + 1]))


def _delay(time: Array, size: Array, quantile: float, reached: float, least_force: float) -> float:
    """How late (s) the force rises, at its rise nearest to the touch at 0 s; NaN without one, or if it is too small.

    quantile: of the force that is taken for that in contact. reached: s, not above 0; a rise from there to 0 is in
    time. least_force: N; a smaller one does not show a contact.
    """
    ordered, level = np.sort(size), quantile * (len(size) - 1)
    below = int(level)
    force = float(ordered[below] + (level - below) * (ordered[min(below + 1, len(size) - 1)] - ordered[below]))
    rises = np.flatnonzero((size[:-1] < SHARE * force) & (size[1:] >= SHARE * force))
    if not len(rises) or force < least_force:
        return float("nan")
    share = (SHARE * force - size[rises]) / (size[rises + 1] - size[rises])
    found = time[rises] + share * (time[rises + 1] - time[rises])
    late = np.maximum(found, 0.0) + np.minimum(found - reached, 0.0)
    return float(late[np.argmin(np.abs(late))])


def _median(values: Array) -> Array:
    """The medians of values (n, ...) over n; numpy's takes four times as long for few."""
    ordered, middle = np.sort(values, axis=0), len(values) // 2
    return np.asarray(ordered[middle] if len(values) % 2 else (ordered[middle - 1] + ordered[middle]) / 2.0)


# --- what the sensor reads without contact: in free motion, and before any at rest near the slider --------------------


class Zero(NamedTuple):
    """Mean (x, y) N of the readings, None before any, and their noise, N."""

    mean: tuple[float, float] | None
    noise: float


class ForceZero:
    """Takes the samples in portions; the zero at a sample is that of the last TARE_SAMPLES readings up to it."""

    def __init__(self) -> None:
        self._free: Array = np.empty((0, 2))  # readings (m, 2) in free motion: the last before the portion, and its own
        self._count: IntArray = np.empty(0, dtype=np.int64)  # of them up to each sample of the portion
        self._resting: deque[tuple[float, float]] = deque(maxlen=TARE_SAMPLES)
        self._known: dict[int, Zero] = {}  # by the number of readings in free motion

    def add(self, force: Array, free: BoolArray) -> BoolArray:
        """Begin a portion of forces (n, 2); free (n,): those in free motion. Returns whether any came up to each."""
        before = self._free[-TARE_SAMPLES:]
        self._free = np.concatenate([before, force[free]])
        self._count = len(before) + np.cumsum(free)
        self._known = {}
        return np.asarray(self._count > 0)

    def rest(self, force: tuple[float, float]) -> None:
        """Add a reading at rest near the slider, which counts until there is one in free motion."""
        self._resting.append(force)
        self._known.pop(0, None)

    def readings(self, sample: int) -> Array:
        """The readings (m, 2) N in free motion at a sample of the portion."""
        return self._last(int(self._count[sample]))

    def at(self, sample: int) -> Zero:
        """The zero at a sample of the portion."""
        return self._of(int(self._count[sample]))

    def above(self, force: Array, samples: IntArray) -> tuple[Array, Array]:
        """Sizes (m,) N of forces (n, 2) over the zero at m samples in order, and its noise (m,) there, N."""
        counts, which = np.unique(self._count[samples], return_inverse=True)
        zeros = [self._of(count) for count in counts.tolist()]
        mean = np.array([zero.mean or (0.0, 0.0) for zero in zeros]).reshape(-1, 2)
        off = force[samples] - mean[which]
        return np.hypot(off[:, 0], off[:, 1]), np.array([zero.noise for zero in zeros])[which]

    def _last(self, count: int) -> Array:
        return self._free[max(count - TARE_SAMPLES, 0) : count]

    def _of(self, count: int) -> Zero:
        if count not in self._known:
            readings = self._last(count) if count else np.array(self._resting)
            if len(readings):
                x, y = readings.mean(axis=0).tolist()
                self._known[count] = Zero((x, y), float(np.hypot(*readings.std(axis=0))))
            else:
                self._known[count] = Zero(None, 0.0)
        return self._known[count]
