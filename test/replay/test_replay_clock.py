# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The replay clock: recorded time runs at a rate, pauses, jumps, and wakes sleepers."""

from __future__ import annotations

import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_predictor.replay.clock import COARSE, SECOND, PlayerClock, SystemClock


class FakeClock:
    """A clock that advances only during sleeps; an endless wait is a fault of the test."""

    def __init__(self) -> None:
        self.time = 0
        self.sleeps: list[int] = []

    def now(self) -> int:
        return self.time

    def sleep(self, duration: int) -> None:
        self.sleeps.append(duration)
        self.time += duration

    def wait(self, condition: threading.Condition, duration: int | None) -> None:
        assert duration is not None, "would wait for ever"
        self.time += duration


def sleep_through(clock: PlayerClock, recorded: int) -> int:
    looks = 1
    while not clock.sleep_until(recorded, clock.generation):
        looks += 1
    return looks


@given(rate=st.floats(0.01, 100.0), recorded=st.integers(0, 3600 * SECOND))
def test_sleeping_takes_the_recorded_time_divided_by_the_rate(rate: float, recorded: int) -> None:
    wall = FakeClock()
    clock = PlayerClock(wall, rate)
    sleep_through(clock, recorded)
    assert wall.time == pytest.approx(recorded / rate, abs=1.0)
    assert clock.now() == pytest.approx(recorded, abs=rate + 1.0)


def test_deadlines_are_absolute_so_lateness_does_not_accumulate() -> None:
    wall = FakeClock()
    clock = PlayerClock(wall)
    for k in range(1, 101):
        sleep_through(clock, k * 1_000_000)
        assert wall.time == k * 1_000_000
        wall.time += 300_000  # publishing takes time


def test_paused_clock_stops_and_resumes_at_the_same_time() -> None:
    wall = FakeClock()
    clock = PlayerClock(wall)
    wall.time = 5 * SECOND
    clock.pause()
    wall.time = 9 * SECOND
    assert clock.now() == 5 * SECOND
    clock.resume()
    wall.time = 10 * SECOND
    assert clock.now() == 6 * SECOND
    assert clock.deadline(7 * SECOND) == 11 * SECOND


def test_new_rate_applies_from_now_on() -> None:
    wall = FakeClock()
    clock = PlayerClock(wall)
    wall.time = 2 * SECOND
    clock.set_rate(10.0)
    wall.time = 3 * SECOND
    assert clock.now() == 12 * SECOND


def test_jump_moves_recorded_time_and_keeps_a_pause() -> None:
    clock = PlayerClock(FakeClock(), paused=True)
    clock.jump(42 * SECOND)
    assert clock.paused
    assert clock.now() == 42 * SECOND


def test_control_before_the_sleep_is_not_missed() -> None:
    wall = FakeClock()
    clock = PlayerClock(wall)
    seen = clock.generation
    clock.jump(0)
    assert not clock.sleep_until(SECOND, seen)
    assert wall.time == 0


def test_last_part_of_a_wait_is_one_plain_sleep() -> None:
    wall = FakeClock()
    sleep_through(PlayerClock(wall), 10 * SECOND)
    assert len(wall.sleeps) == 1
    assert wall.sleeps[0] <= COARSE


@pytest.mark.parametrize("control", ["pause", "interrupt", "jump"])
def test_control_wakes_a_long_sleep(control: str) -> None:
    clock = PlayerClock(SystemClock())
    arguments = [0] if control == "jump" else []
    timer = threading.Timer(0.05, getattr(clock, control), arguments)
    timer.start()
    begin = time.monotonic()
    assert not clock.sleep_until(60 * SECOND, clock.generation)
    assert time.monotonic() - begin < 5.0
    timer.join()
