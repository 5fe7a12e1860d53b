"""The clock of a replay: recorded time as a function of the wall's. Everything that waits, waits here."""

from __future__ import annotations

import ctypes
import sys
import threading
import time
from typing import Protocol

SECOND = 1_000_000_000
COARSE = 20_000_000  # ns: longer sleeps wait on a condition, which a control can end; the rest is one plain sleep


class Wall(Protocol):
    """The time that passes, ns; replaced by a fake in tests."""

    def now(self) -> int:
        """Steady time, ns."""

    def sleep(self, duration: int) -> None:
        """Sleep for so many ns."""

    def wait(self, condition: threading.Condition, duration: int | None) -> None:
        """Wait on a condition that is held, at most so many ns."""


class SystemWall:
    """The machine's steady clock, the one of perf_counter."""

    def now(self) -> int:
        """Steady time, ns."""
        return time.perf_counter_ns()

    def sleep(self, duration: int) -> None:
        """Sleep for so many ns."""
        time.sleep(duration / SECOND)

    def wait(self, condition: threading.Condition, duration: int | None) -> None:
        """Wait on a condition that is held, at most so many ns."""
        condition.wait(None if duration is None else duration / SECOND)


class PlayerClock:
    """Recorded time, ns: it runs at a rate, pauses and jumps.

    Deadlines are absolute, from one pair (recorded time, wall time) that only a control replaces, so that lateness
    never adds up. generation counts the controls: a sleeper hands in the count it has seen, and any later control
    wakes it.
    """

    def __init__(self, wall: Wall, rate: float = 1.0, paused: bool = False, spin: int = 0) -> None:
        self._wall = wall
        self._rate = rate
        self._paused = paused
        self._spin = spin
        self._recorded, self._at = 0, wall.now()
        self._changed = threading.Condition()
        self.generation = 0

    @property
    def paused(self) -> bool:
        """Does it stand still?"""
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
        """The wall time of a recorded time, if nothing is changed until then, ns."""
        with self._changed:
            return self._deadline(recorded)

    def set_rate(self, rate: float) -> None:
        """Run at another rate from now on; rate > 0."""
        self._change(rate=rate)

    def pause(self) -> None:
        """Stand still."""
        self._change(paused=True)

    def resume(self) -> None:
        """Run again from where it stands."""
        self._change(paused=False)

    def jump(self, recorded: int) -> None:
        """Go on from another recorded time."""
        self._change(recorded=recorded)

    def interrupt(self) -> None:
        """Wake the sleeper and leave the time as it is."""
        with self._changed:
            self.generation += 1
            self._changed.notify_all()

    def sleep_until(self, recorded: int, generation: int) -> bool:
        """Sleep until a recorded time. False if the caller shall look again: a control came, or much time is left."""
        with self._changed:
            if generation != self.generation:
                return False
            left = None if self._paused else self._deadline(recorded) - self._wall.now()
            if left is None or left > COARSE:
                self._wall.wait(self._changed, None if left is None else left - COARSE // 2)
                return False
            deadline = self._deadline(recorded)
        self._sleep_to(deadline)
        return generation == self.generation

    def _sleep_to(self, deadline: int) -> None:
        if (left := deadline - self._wall.now() - self._spin) > 0:
            self._wall.sleep(left)
        while self._spin and self._wall.now() < deadline:
            pass

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


def sharpen_sleep() -> None:
    """Let this thread's sleeps end within 1 ns of slack instead of Linux's 50 us."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(29, 1)  # PR_SET_TIMERSLACK
