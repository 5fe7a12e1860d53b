# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Filter one stream while samples arrive: discard repeated, late and future stamps and brief jumps.

A stamp is checked against the samples that arrive after it, not against a clock, because a replayed recording keeps its
stamps. Of the next LOOKAHEAD samples the longest increasing sequence of stamps is accepted and the rest is discarded.
So a single stamp that is a day ahead costs only its own sample.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.streams import joined, taken
from push_predictor.types import Array, BoolArray, IntArray

LOOKAHEAD = 8  # samples examined before the first of them is accepted
LATE_RUN = LOOKAHEAD // 2  # consecutive late samples after which the clock was set back a little and data are missing
ISOLATION = 1_000_000_000  # ns; a sample this far from both neighbours is discarded
CLOCK_LEAP = 30 * 86_400_000_000_000  # ns; a clock this far ahead was set: no recording pauses for a month
REMEMBERED = 2000  # accepted stamps kept to recognise a repeated one
NO_STAMP = np.iinfo(np.int64).min // 2

# From values before (n, k), values after (n, k) and the time between them (n,) s to (n,).
IsJump = Callable[[Array, Array, Array], BoolArray]


@dataclass(frozen=True, eq=False)
class OrderedSamples:
    """Samples with increasing stamps: stamp (n,) ns, values (n, k). interrupted (n,): data before it are missing."""

    stamp: IntArray
    values: Array
    interrupted: BoolArray

    def __len__(self) -> int:
        return len(self.stamp)


def uninterrupted(stamp: IntArray, values: Array) -> OrderedSamples:
    """Samples with increasing stamps (n,) ns and values (n, k) of which none are missing."""
    return OrderedSamples(stamp, values, np.zeros(len(stamp), dtype=np.bool_))


class Portions:
    """The samples of one stream that arrive in portions: those that wait, after those that are needed to judge them."""

    def __init__(self) -> None:
        self._samples: OrderedSamples | None = None
        self._returned = 0  # of these samples

    @property
    def waiting(self) -> int:
        """How many samples wait."""
        return 0 if self._samples is None else len(self._samples) - self._returned

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        raise NotImplementedError  # each repair has its own

    def _with(self, new: OrderedSamples) -> OrderedSamples:
        """The kept samples and further ones."""
        return new if self._samples is None else joined([self._samples, new])

    def _keep(self, samples: OrderedSamples, rows: slice | IntArray, returned: int) -> None:
        """Keep some of the samples, of which the first are returned."""
        self._samples, self._returned = taken(samples, rows), returned


class StampOrder:
    """Takes samples as they arrive and returns those that are in order.

    is_jump: which values cannot follow others within a time; None accepts all. counts: discarded samples by kind
    (repeated, late, ahead, jumps). waiting: stamps and values of the samples that are not decided yet. clock_set:
    whether these have the time of a clock that was set.
    """

    def __init__(self, width: int, is_jump: IsJump | None = None) -> None:
        self.counts: Counter[str] = Counter()
        self.waiting: tuple[IntArray, Array] = (np.empty(0, dtype=np.int64), np.empty((0, width)))
        self.clock_set = False
        self.is_jump = is_jump
        self._last = NO_STAMP
        self._last_values: Array | None = None
        self._recent: deque[int] = deque(maxlen=REMEMBERED)
        self._late_since_last = 0

    def take(self, stamp: IntArray, values: Array, final: bool = False) -> OrderedSamples:
        """Add samples (n,), (n, k) and return the accepted ones; with `final` all are decided."""
        stamp, values = np.concatenate([self.waiting[0], stamp]), np.concatenate([self.waiting[1], values])
        keep, interrupted = np.zeros(len(stamp), dtype=np.bool_), np.zeros(len(stamp), dtype=np.bool_)
        irregular = self._irregular(stamp, values)
        place, self.clock_set = 0, False
        while place < len(stamp) and (final or len(stamp) - place >= LOOKAHEAD):
            accepted = self._regular_run(stamp, values, irregular, place, final)
            if not accepted:
                chosen, discarded = self._decide(stamp[place : place + LOOKAHEAD].tolist(), values[place:])
                place, accepted = place + discarded, int(chosen)
                if self.clock_set:
                    break
            if accepted:
                keep[place : place + accepted] = True
                interrupted[place] = self._late_since_last >= LATE_RUN
                self._recent.extend(stamp[place : place + accepted][-REMEMBERED:].tolist())
                place += accepted
                self._last, self._last_values, self._late_since_last = int(stamp[place - 1]), values[place - 1], 0
        self.waiting = stamp[place:], values[place:]
        return OrderedSamples(stamp[keep], values[keep], interrupted[keep])

    def _irregular(self, stamp: IntArray, values: Array) -> list[int]:
        """Indices of samples whose successor does not follow regularly."""
        step = np.diff(stamp)
        irregular = (step <= 0) | (step > ISOLATION)
        if self.is_jump is not None and len(step):
            irregular |= self.is_jump(values[:-1], values[1:], step * 1e-9)
        return [*np.flatnonzero(irregular).tolist(), len(stamp) - 1]

    def _regular_run(self, stamp: IntArray, values: Array, irregular: Sequence[int], place: int, final: bool) -> int:
        """Number of samples from `place` on that follow regularly and are followed by LOOKAHEAD - 1 regular ones."""
        first = int(stamp[place])
        if not 0 < first - self._last <= ISOLATION or self._jumps_to(values[place], first):
            return 0
        end = irregular[bisect_left(irregular, place)]  # the last sample of the run
        complete = final and end == len(stamp) - 1
        return max(0, end - place + 1 - (0 if complete else LOOKAHEAD - 1))

    def _jumps_to(self, values: Array, stamp: int) -> bool:
        return self._last_values is not None and self._jumps(self._last_values, values, stamp - self._last)

    def _jumps(self, before: Array, after: Array, elapsed: int) -> bool:
        if self.is_jump is None:
            return False
        return bool(self.is_jump(before[None], after[None], np.array([elapsed * 1e-9]))[0])

    def _decide(self, block: list[int], values: Array) -> tuple[bool, int]:
        """How many of the first samples are discarded, after whether the one after them is accepted."""
        sequence = _longest_increasing(block, self._last)
        if not sequence:
            return self._decide_late(block)
        for stamp in block[: sequence[0]]:
            self._discard("ahead" if stamp > self._last else self._kind_of_old(stamp))
        stamp, after = block[sequence[0]], block[sequence[1]] if len(sequence) > 1 else None
        if self._last != NO_STAMP and stamp - self._last > CLOCK_LEAP and after is not None:
            self.clock_set = True
            return False, sequence[0]
        if self._is_isolated(stamp, after):
            self._discard("late" if self._last == NO_STAMP and after is not None else "ahead")
            return False, sequence[0] + 1
        if back := self._return_from_jump(block, values, sequence):
            for _ in range(back - sequence[0]):
                self._discard("jumps")
            return False, back
        return True, sequence[0]

    def _return_from_jump(self, block: list[int], values: Array, sequence: list[int]) -> int:
        """Index of the first sample that jumps back to where the stream was, if the first of `sequence` jumps; else 0.

        Back is close to the last sample before, or away from there only by motion in the meantime: then the two jumps
        are opposite.
        """
        first = sequence[0]
        if self._last_values is None or not self._jumps_to(values[first], block[first]):
            return 0
        jump, elapsed = values[first] - self._last_values, block[first] - self._last
        for before, k in pairwise(sequence):
            step = block[k] - block[before]
            if self._jumps(values[before], values[k], step):
                opposite = not self._jumps(jump, values[before] - values[k], elapsed + step)
                if opposite or not self._jumps_to(values[k], block[first]):
                    return k
        return 0

    def _decide_late(self, block: list[int]) -> tuple[bool, int]:
        sequence = _longest_increasing(block, NO_STAMP)
        increasing = len(block) == LOOKAHEAD and 2 * len(sequence) >= LOOKAHEAD
        if increasing and block[sequence[0]] < self._last - CLOCK_SET:
            self.clock_set = True
            return False, 0
        self._discard(self._kind_of_old(block[0]))
        return False, 1

    def _kind_of_old(self, stamp: int) -> str:
        return "repeated" if stamp in self._recent else "late"

    def _is_isolated(self, stamp: int, after: int | None) -> bool:
        """Whether a stamp is far from those before and after; the very first one only needs a near successor."""
        far_before = stamp - self._last > ISOLATION
        far_after = after is None or after - stamp > ISOLATION
        return far_before and far_after and not (self._last == NO_STAMP and after is None)

    def _discard(self, kind: str) -> None:
        self.counts[kind] += 1
        self._late_since_last += kind == "late"


def _longest_increasing(block: Sequence[int], last: int) -> list[int]:
    """Indices of the longest sequence of increasing stamps after `last`; of equally long ones the first to arrive."""
    best: list[list[int]] = [[] for _ in block]
    for k in range(len(block) - 1, -1, -1):
        if block[k] > last:
            later = [best[j] for j in range(k + 1, len(block)) if block[j] > block[k]]
            best[k] = [k, *max(later, key=len, default=[])]
    return max(best, key=len, default=[])
