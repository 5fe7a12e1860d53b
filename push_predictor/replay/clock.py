# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The clock of a replay: recorded time as a function of wall time. All waiting happens here."""

from __future__ import annotations

import threading
import time

SECOND = 1_000_000_000
COARSE = 20_000_000  # ns: a longer sleep waits on a condition that a control notifies; the rest is one plain sleep


class SystemClock:
    """The machine's steady clock, the one of perf_counter; tests replace it by a fake."""

    def now(self) -> int:
        """Steady time, ns."""
        return time.perf_counter_ns()

    def sleep(self, duration: int) -> None:
        """Sleep for so many ns."""
        time.sleep(duration / SECOND)

    def wait(self, condition: threading.Condition, duration: int | None) -> None:
        """Wait on a locked condition, at most so many ns."""
        condition.wait(None if duration is None else duration / SECOND)


class PlayerClock:
    """Recorded time, ns: it runs at a rate, pauses and jumps.

    Deadlines are absolute: they follow from one pair (recorded time, wall time), which only a control replaces.
    Lateness therefore never accumulates. generation counts the controls: a sleeper passes the count that it has seen,
    and any later control wakes it.
    """

    def __init__(self, wall: SystemClock, rate: float = 1.0, paused: bool = False) -> None:
        self._wall = wall
        self._rate = rate
        self._paused = paused
        self._recorded, self._at = 0, wall.now()
        self._changed = threading.Condition()
        self.generation = 0

    @property
    def paused(self) -> bool:
        """Whether the clock is paused."""
        return self._paused

    @property
    def rate(self) -> float:
        """Recorded seconds per second."""
        return self._rate

    def now(self) -> int:
        """Recorded time, ns."""
        with self._changed:
            return self._now()

    def deadline(self, recorded: int) -> int:
        """The wall time of a recorded time, ns, if no control comes before."""
        with self._changed:
            return self._deadline(recorded)

    def set_rate(self, rate: float) -> None:
        """Run at another rate from now on; rate > 0."""
        self._change(rate=rate)

    def pause(self) -> None:
        """Stop the recorded time."""
        self._change(paused=True)

    def resume(self) -> None:
        """Continue from the present recorded time."""
        self._change(paused=False)

    def jump(self, recorded: int) -> None:
        """Continue from another recorded time."""
        self._change(recorded=recorded)

    def interrupt(self) -> None:
        """Wake the sleeper without changing the time."""
        with self._changed:
            self.generation += 1
            self._changed.notify_all()

    def sleep_until(self, recorded: int, generation: int) -> bool:
        """Sleep until a recorded time. False if the caller must check again.

        It must when a control came, or when the time is still far away.
        """
        with self._changed:
            if generation != self.generation:
                return False
            remaining = None if self._paused else self._deadline(recorded) - self._wall.now()
            if remaining is None or remaining > COARSE:
                self._wall.wait(self._changed, None if remaining is None else remaining - COARSE // 2)
                return False
            deadline = self._deadline(recorded)
        if (remaining := deadline - self._wall.now()) > 0:
            self._wall.sleep(remaining)
        return generation == self.generation

    def _change(self, rate: float | None = None, paused: bool | None = None, recorded: int | None = None) -> None:
        with self._changed:
            self._recorded, self._at = self._now() if recorded is None else recorded, self._wall.now()
            self._rate = self._rate if rate is None else rate
            self._paused = self._paused if paused is None else paused
            self.generation += 1
            self._changed.notify_all()

    def _now(self) -> int:
        if self._paused:
            return self._recorded
        return self._recorded + round((self._wall.now() - self._at) * self._rate)

    def _deadline(self, recorded: int) -> int:
        return self._at + round((recorded - self._recorded) / self._rate)
