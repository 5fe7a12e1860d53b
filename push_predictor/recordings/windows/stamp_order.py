"""Putting the samples of one stream right while they arrive: stamps that come twice, too late or from the future.

A stamp is judged by those that arrive after it, not by a clock: a recording keeps its stamps when it is replayed. Of
the next HELD samples the longest row of rising stamps is believed; what does not fit it is left out. So one stamp that
is a day ahead costs its own sample, and none of those that follow.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array, BoolArray, IntArray

HELD = 8  # samples that are looked at before the first of them is believed
STEP_BACK = HELD // 2  # late samples in a row after which the clock was put back a little, and time is missing
FAR = 1_000_000_000  # ns; a sample this far from both its neighbours is none, and a clock that goes back so far was set
LEAP = 30 * 86_400_000_000_000  # ns; a clock that goes ahead so far was set: nobody pauses a month
RECENT = 2000  # samples by which a repeated stamp is known
NONE = np.iinfo(np.int64).min // 2

Torn = Callable[[Array, Array, Array], BoolArray]  # values before (n, k) and after (n, k), lapse (n,) s -> (n,)


@dataclass(frozen=True, eq=False)
class Ordered:
    """Samples with rising stamps: stamp (n,) ns, values (n, k); broken (n,): do not join to the one before.

    clock_set: those that still wait are of a clock that was set.
    """

    stamp: IntArray
    values: Array
    broken: BoolArray
    clock_set: bool


class StampOrder:
    """Takes samples as they arrive, gives those that can be believed.

    torn: which values cannot follow others within a time; None: any may. counts: the samples left out, by kind
    (repeated, late, ahead, jumps).
    """

    def __init__(self, width: int, torn: Torn | None = None) -> None:
        self.counts: Counter[str] = Counter()
        self.waiting: tuple[IntArray, Array] = (np.empty(0, dtype=np.int64), np.empty((0, width)))
        self.torn = torn
        self._last = NONE
        self._last_values: Array | None = None
        self._recent: deque[int] = deque(maxlen=RECENT)
        self._behind = 0  # late samples since the last good one

    def take(self, stamp: IntArray, values: Array, final: bool = False) -> Ordered:
        """Add samples (n,), (n, k); returns those that are settled, with `final` also the last ones."""
        stamp, values = np.concatenate([self.waiting[0], stamp]), np.concatenate([self.waiting[1], values])
        keep, broken = np.zeros(len(stamp), dtype=np.bool_), np.zeros(len(stamp), dtype=np.bool_)
        rough = self._rough(stamp, values)
        place, clock_set = 0, False
        while place < len(stamp) and (final or len(stamp) - place >= HELD):
            if calm := self._calm(stamp, values, rough, place, final):
                keep[place : place + calm] = True
                broken[place] = self._behind >= STEP_BACK
                self._note(stamp[place : place + calm], values[place + calm - 1])
                place += calm
                continue
            chosen, skipped, clock_set = self._choose(stamp[place : place + HELD].tolist(), values[place:])
            place += skipped
            if clock_set:
                break
            if chosen:
                keep[place], broken[place] = True, self._behind >= STEP_BACK
                self._note(stamp[place : place + 1], values[place])
                place += 1
        self.waiting = stamp[place:], values[place:]
        return Ordered(stamp[keep], values[keep], broken[keep], clock_set)

    def _rough(self, stamp: IntArray, values: Array) -> list[int]:
        """Samples whose successor does not simply follow."""
        step = np.diff(stamp)
        rough = (step <= 0) | (step > FAR)
        if self.torn is not None and len(step):
            rough |= self.torn(values[:-1], values[1:], step * 1e-9)
        return [*np.flatnonzero(rough).tolist(), len(stamp) - 1]

    def _calm(self, stamp: IntArray, values: Array, rough: Sequence[int], place: int, final: bool) -> int:
        """How many samples from `place` on follow simply, and are followed so by HELD - 1 others."""
        if not self._follows(int(stamp[place]), values[place]):
            return 0
        end = rough[bisect_left(rough, place)]  # the last of the row
        whole = final and end == len(stamp) - 1
        return max(0, end - place + 1 - (0 if whole else HELD - 1))

    def _follows(self, stamp: int, values: Array) -> bool:
        return 0 < stamp - self._last <= FAR and not self._is_torn(values, stamp)

    def _is_torn(self, values: Array, stamp: int) -> bool:
        if self.torn is None or self._last_values is None:
            return False
        return bool(self.torn(self._last_values[None], values[None], np.array([(stamp - self._last) * 1e-9]))[0])

    def _choose(self, block: list[int], values: Array) -> tuple[bool, int, bool]:
        """What becomes of the first of some samples: is it (after those skipped) good, how many go, was a clock set."""
        row = _longest_row(block, self._last)
        if not row:
            return self._late(block)
        for stamp in block[: row[0]]:
            self._leave_out("ahead" if stamp > self._last else self._kind_of_old(stamp))
        stamp, after = block[row[0]], block[row[1]] if len(row) > 1 else None
        if self._last != NONE and stamp - self._last > LEAP and after is not None:
            return False, row[0], True
        if self._is_alone(stamp, after):
            self._leave_out("late" if self._last == NONE and after is not None else "ahead")
            return False, row[0] + 1, False
        if back := self._comes_back(values, row, stamp):
            for _ in range(back - row[0]):
                self._leave_out("jumps")
            return False, back, False
        return True, row[0], False

    def _comes_back(self, values: Array, row: list[int], stamp: int) -> int:
        """Where a row of samples that begins with a leap is back again, by what one step may be; 0 if never."""
        if not self._is_torn(values[row[0]], stamp):
            return 0
        return next((k for k in row[1:] if not self._is_torn(values[k], stamp)), 0)

    def _late(self, block: list[int]) -> tuple[bool, int, bool]:
        row = _longest_row(block, NONE)
        if len(block) == HELD and 2 * len(row) >= HELD and block[row[0]] < self._last - FAR:
            return False, 0, True
        self._leave_out(self._kind_of_old(block[0]))
        return False, 1, False

    def _kind_of_old(self, stamp: int) -> str:
        return "repeated" if stamp in self._recent else "late"

    def _is_alone(self, stamp: int, after: int | None) -> bool:
        """Far from the samples before and after? The first one of all is good if another follows near."""
        far_before = stamp - self._last > FAR
        far_after = after is None or after - stamp > FAR
        return far_before and far_after and not (self._last == NONE and after is None)

    def _leave_out(self, kind: str) -> None:
        self.counts[kind] += 1
        self._behind += kind == "late"

    def _note(self, stamps: IntArray, last_values: Array) -> None:
        self._last, self._last_values, self._behind = int(stamps[-1]), last_values, 0
        self._recent.extend(stamps[-RECENT:].tolist())


def _longest_row(block: Sequence[int], last: int) -> list[int]:
    """Places of the longest row of rising stamps after `last`; of rows of one length the one that arrived first."""
    rows: list[list[int]] = [[] for _ in block]
    for k in range(len(block) - 1, -1, -1):
        if block[k] > last:
            later = [rows[j] for j in range(k + 1, len(block)) if block[j] > block[k]]
            rows[k] = [k, *max(later, key=len, default=[])]
    return max(rows, key=len, default=[])
