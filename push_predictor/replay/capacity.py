# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How fast this machine can play a recording, estimated from its first messages before the playback begins."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice

from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.clock import SECOND, PlayerClock, SteadyClock
from push_predictor.replay.play_range import PlayRange
from push_predictor.replay.player import PlayerOutput, ReplayPlayer
from push_predictor.replay.source import Source

MOST = 2000  # messages to time; some 30 ms, before the playback begins
# CPU times for a message, over that to read it (docs/explanation/replay.md)
PUBLISHING = 1.7  # to publish it to one subscriber in another process
TAKING = 11.0  # of a subscriber in Python (rclpy) that takes messages as fast as it can
_AT_ONCE = 1.0e12  # recorded seconds per second: every message is due


@dataclass(frozen=True)
class Capacity:
    """Messages per second: recorded, playable to one subscriber, and taken by a subscriber in Python.

    The last two are those of free cores of this machine, one for each of the two processes.
    """

    recorded: float
    playable: float
    taken: float

    @property
    def largest_rate(self) -> float:
        """The rate above which the replay falls behind."""
        return self.playable / self.recorded

    @property
    def largest_lossless_rate(self) -> float:
        """The rate above which the queue of a subscriber in Python overflows, unless it keeps all messages."""
        return min(self.taken, self.playable) / self.recorded

    def to_text(self, rate: float) -> str:
        """State what a replay at this rate requires, and the largest rates."""
        return (
            f"{self.recorded:.0f} messages/s recorded, {self.recorded * rate:.0f} messages/s at rate {rate:g}. "
            f"A free core of this machine plays about {self.playable:.0f} messages/s: rate {self.largest_rate:.3g}. "
            f"A subscriber in Python takes about {self.taken:.0f} messages/s: "
            f"nothing is lost up to rate {self.largest_lossless_rate:.3g}, or with history KEEP_ALL"
        )


def measure_capacity(
    source: Source, wall: SteadyClock, cpu_time: Callable[[], int] = time.thread_time_ns
) -> Capacity | None:
    """Play the first messages of a source, MOST of them, to nobody. None if they have no two different times.

    cpu_time: of this thread, ns. A short measurement of wall time would be one of what else the machine does.
    """
    times: list[int] = []
    begin = cpu_time()
    _play_at_once(_Beginning(source), wall, times)
    return capacity(times, cpu_time() - begin)


def capacity(times: list[int], reading: int) -> Capacity | None:
    """The capacity of a machine that reads messages of these log times (ns) in `reading` ns of CPU time."""
    span = max(times) - min(times) if times else 0
    if not span or reading <= 0:
        return None
    read = len(times) * SECOND / reading
    return Capacity((len(times) - 1) * SECOND / span, read / (1.0 + PUBLISHING), read / TAKING)


class _Beginning:
    """The first messages of a source."""

    def __init__(self, source: Source) -> None:
        self._source, self.start = source, source.start

    def messages(self, start: int) -> Iterator[RawMessage]:
        """The first messages, roughly in order."""
        return islice(self._source.messages(start), MOST)


def _play_at_once(source: Source, wall: SteadyClock, times: list[int]) -> None:
    """Let a player read and sort all messages and compute their deadlines; adds their log times to `times`."""

    def prepare(message: RawMessage) -> Callable[[], bool]:
        return partial(publish, message.log_time)

    def publish(time: int) -> bool:
        times.append(time)
        return True

    def announce(state: str) -> None:
        if state == "finished":
            player.close()

    output = PlayerOutput(prepare, lambda: None, announce)
    player = ReplayPlayer(source, PlayerClock(wall, _AT_ONCE), wall, output, MOST // 2, loop=False, delay=0)
    player.play(PlayRange())
    player.run()
