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

from push_predictor.recordings.windows.contact import NEAR, ContactSample
from push_predictor.types import Array

SEARCHED = 0.5  # s before and after a touch in which its force is looked for
PAUSE = 0.1  # s without contact before a touch
LEVEL = 80.0  # percentile of the force before and after a touch that is taken for that in contact
SHARE = 0.5  # of the force in contact, at which it is said to rise: a filter delays this point by its delay
RESTED = 0.0005  # m that the slider moves at most in PAUSE before a touch: it begins no motion otherwise
CARRIED = 0.001  # m that the slider moves after a touch: a tip that only passes it pushes nothing
STEADY = 0.2  # s after a touch in which the gap is that of a contact
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
    middle = float(np.median(known))
    spread = max(SPREAD * float(np.median(np.abs(known - middle))), SAMPLING)
    return ForceDelay(middle, float(spread / np.sqrt(len(known))), len(values), missing)


class ForceTiming:
    """Takes the samples in order.

    touches: time (s) of each touch so far, and the delay of the force (s), NaN where it does not show the contact.
    """

    def __init__(self) -> None:
        self.touches: list[tuple[float, float]] = []
        self.apart = False
        self._samples: deque[ContactSample] = deque()  # of the last SEARCHED, and since a touch that is not judged yet
        self._touch: ContactSample | None = None
        self._last_contact = -np.inf

    def add(
        self,
        sample: ContactSample,
        contact: bool,
        free_force: Sequence[tuple[float, float]],
        least_force: Callable[[], float],
    ) -> None:
        """Add a sample. contact: whether the geometry shows one; free_force: what the sensor last read without one.

        least_force: N, a smaller one does not show a contact; asked at a touch only.
        """
        if sample.force is None or sample.after_break or not free_force:
            self._samples.clear()
            self._touch, self._last_contact = None, sample.time
            return
        self._samples.append(sample)
        if self._touch is None:
            while self._samples[0].time < sample.time - SEARCHED:
                self._samples.popleft()
            if contact and sample.time - self._last_contact > PAUSE:
                self._touch = sample
        elif sample.time > self._touch.time + SEARCHED:
            self._judge(self._touch, np.median(free_force, axis=0), least_force())
        if contact:
            self._last_contact = sample.time

    def _judge(self, touch: ContactSample, zero: Array, least_force: float) -> None:
        self._touch = None
        before = next(sample for sample in self._samples if sample.time >= touch.time - PAUSE)
        rested = math.dist(before.place, touch.place) < RESTED
        if not rested or math.dist(touch.place, self._samples[-1].place) < CARRIED or not self._exact(touch.time):
            return
        time = np.array([sample.time for sample in self._samples]) - touch.time
        size = np.hypot(*(np.array([sample.force for sample in self._samples]) - zero).T)
        # The last of the approach, at which the gap still shrinks by as much.
        time -= NEAR * max(touch.closing_speed, 0.0) / touch.speed
        self.touches.append((touch.time, _delay(time, size, least_force)))
        delays = [delay for _, delay in self.touches]
        unseen = len(delays) >= UNSEEN and not np.isfinite(delays[-UNSEEN:]).any()
        self.apart = unseen or force_delay(delays).apart or force_delay(delays[-RECENT:]).apart

    def _exact(self, touch: float) -> bool:
        """Whether the gap shows the touch exactly: it has little noise after it, and samples close to each other."""
        after = [(each.time, each.gap) for each in self._samples if touch <= each.time <= touch + STEADY]
        time, gap = np.array(after).T
        noise = float(np.std(np.diff(gap))) / np.sqrt(2.0)
        return noise < GAP_NOISE and float(np.max(np.diff(time))) <= NEAR


def _delay(time: Array, size: Array, least_force: float) -> float:
    """The time (s) of the rise that is nearest to 0; NaN without one, or if the force is below least_force (N)."""
    force = float(np.percentile(size, LEVEL))
    rises = np.flatnonzero((size[:-1] < SHARE * force) & (size[1:] >= SHARE * force))
    if not len(rises) or force < least_force:
        return float("nan")
    share = (SHARE * force - size[rises]) / (size[rises + 1] - size[rises])
    found = time[rises] + share * (time[rises + 1] - time[rises])
    return float(found[np.argmin(np.abs(found))])
