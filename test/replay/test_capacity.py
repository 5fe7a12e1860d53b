# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The estimate of the largest rate that a machine can play."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.capacity import MOST, PUBLISHING, TAKING, Capacity, capacity, measure_capacity

MS = 1_000_000


class Ticking:
    """A wall clock that advances by 1 us each time it is read, and that nobody may sleep by."""

    def __init__(self) -> None:
        self.time = 0

    def now(self) -> int:
        self.time += 1000
        return self.time

    def sleep(self, duration: int) -> None:
        raise AssertionError("the estimate must not wait")

    def wait(self, condition: threading.Condition, duration: int | None) -> None:
        raise AssertionError("the estimate must not wait")


class Messages:
    """Messages of given times after the start, ns; read: how many were asked for."""

    def __init__(self, *times: int) -> None:
        self.start, self.read = 5 * MS, 0
        self._times = times

    def messages(self, start: int) -> Iterator[RawMessage]:
        for time in self._times:
            self.read += 1
            yield RawMessage("/a", "std_msgs/msg/String", self.start + time, b"")


def test_the_largest_rate_is_the_ratio_of_playable_and_recorded_messages() -> None:
    found = capacity([10 * MS * k for k in range(101)], reading=MS)  # 101 messages of 1 s, read in 1 ms
    assert found is not None
    assert found.recorded == pytest.approx(100.0)
    assert found.playable == pytest.approx(101_000.0 / (1.0 + PUBLISHING))
    assert found.largest_rate == pytest.approx(1010.0 / (1.0 + PUBLISHING))
    assert found.to_text(2.0).startswith("100 messages/s recorded, 200 messages/s at rate 2. ")
    assert f"plays about {found.playable:.0f} messages/s: rate 374. " in found.to_text(2.0)


def test_a_subscriber_in_python_limits_the_rate_without_loss() -> None:
    found = capacity([10 * MS * k for k in range(101)], reading=MS)
    assert found is not None
    assert found.taken == pytest.approx(101_000.0 / TAKING) and found.taken < found.playable
    assert found.largest_lossless_rate == pytest.approx(1010.0 / TAKING)
    assert "takes about 9182 messages/s: nothing is lost up to rate 91.8, or with history KEEP_ALL" in found.to_text(
        2.0
    )


def test_a_rate_that_the_player_cannot_reach_is_not_stated_as_without_loss() -> None:
    assert Capacity(recorded=100.0, playable=500.0, taken=900.0).largest_lossless_rate == pytest.approx(5.0)


@pytest.mark.parametrize("times", [[], [7], [7, 7]])
def test_messages_of_one_time_have_no_rate(times: list[int]) -> None:
    assert capacity(times, MS) is None


def test_all_messages_of_a_short_recording_are_played_at_once() -> None:
    looks = iter((7, 7 + MS))
    found = measure_capacity(Messages(*range(0, 1001 * MS, 10 * MS)), Ticking(), lambda: next(looks))
    assert found == capacity([10 * MS * k for k in range(101)], MS)


def test_the_work_of_the_player_is_timed() -> None:
    found = measure_capacity(Messages(*range(0, 1001 * MS, 10 * MS)), Ticking())
    assert found is not None and 0.0 < found.playable < 1.0e7


def test_at_most_a_limited_number_of_messages_is_read() -> None:
    source = Messages(*range(0, 10_000 * 10 * MOST, 10_000))
    found = measure_capacity(source, Ticking())
    assert found is not None and source.read == MOST
    assert found.recorded == pytest.approx(100_000.0)
