# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The live scalar topics: subscribed when they appear; messages without a header are dated by /clock."""

from __future__ import annotations

import struct
import sys
from bisect import bisect_right
from dataclasses import replace
from time import time_ns

import numpy as np
from rclpy.node import Node

from push_predictor.nodes.polling import FollowingSubscription, Taken
from push_predictor.nodes.validator.live_streams import TopicStream, as_messages
from push_predictor.recordings.decoder.topic_input import LIMIT, TopicInput

CLOCK, CLOCK_TYPE = "/clock", "rosgraph_msgs/msg/Clock"
CLOCKS = 4000  # messages of /clock that are kept
DELAY = 1_000_000_000  # ns after sending a message within which its /clock arrives, if there is one
STALE = 5_000_000_000  # ns after the last message of a /clock without publisher, when its time expires


class ClockHistory:
    """The times published on /clock, by the time (ns) of their sending. published: whether it has a publisher."""

    def __init__(self) -> None:
        self.published = False
        self._sent: list[int] = []
        self._clock: list[int] = []

    def put(self, data: bytes, sent: int) -> None:
        """Add a message of /clock."""
        if len(data) < 12:  # of another type
            return
        seconds, rest = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
        self._sent.append(max(sent, self._sent[-1] if self._sent else 0))
        self._clock.append(seconds * 1_000_000_000 + rest)
        if len(self._sent) > CLOCKS:
            del self._sent[: CLOCKS // 2], self._clock[: CLOCKS // 2]

    def known_until(self, now: int) -> int:
        """The sending time (ns) up to which messages can be dated at a time."""
        return self._sent[-1] if self.published and self._sent else now - DELAY

    def at(self, sent: int) -> int | None:
        """The time (ns) published last before something was sent, None if it is not known.

        Without /clock, or long after its end, the time of sending itself.
        """
        if not self._sent or (not self.published and sent > self._sent[-1] + STALE):
            return sent
        place = bisect_right(self._sent, sent)
        return self._clock[place - 1] if place else None


class ClockTopic:
    """Moves the messages of /clock into a history. Call `look` in the executor's thread."""

    def __init__(self, node: Node) -> None:
        self._ticks, self.history = FollowingSubscription(node, CLOCK, _no_clock), ClockHistory()

    def look(self) -> None:
        """Subscribe as it is published."""
        self._ticks.look()
        self.history.published = bool(self._ticks.offered)

    def move(self) -> None:
        """Move arrived messages from the middleware."""
        for tick in self._ticks.taken():
            self.history.put(tick.message, tick.sent)


class ScalarTopic(TopicStream):
    """A scalar's topic, whose messages may have no stamp: they wait until their time on /clock is known."""

    def __init__(self, node: Node, name: str, own: TopicInput, clock: ClockHistory) -> None:
        super().__init__(node, f"topic:{name}", own)
        self._clock = clock
        self._undated: list[Taken] = []

    def __len__(self) -> int:
        """How many messages wait."""
        return len(self.own) + len(self._undated)

    def move(self) -> None:
        """Move arrived messages from the middleware."""
        if self.own.timed:
            super().move()
        else:
            self._undated += self.subscription.taken()
            del self._undated[:-LIMIT]

    def date(self, last: bool = False) -> None:
        """Date the messages whose time on /clock is known by now; last: all. Not at the same time as `move`."""
        until = sys.maxsize if last else self._clock.known_until(time_ns())
        due = [message for message in self._undated if message.sent < until]
        self._undated = [message for message in self._undated if message.sent >= until]
        times = [self._clock.at(message.sent) for message in due]
        dated = [message for message, time in zip(due, times, strict=True) if time is not None]
        if len(dated) < len(due):
            self.own.received += len(due) - len(dated)
            self.own.rejected["without time"] += len(due) - len(dated)
        if dated:
            messages, arrived = as_messages(dated, self.own.source.topic, self.own.kind)
            known = np.array([time for time in times if time is not None], np.int64)
            self.own.put(replace(messages, times=known), arrived)


def _no_clock(kind: str) -> str:
    return "" if kind == CLOCK_TYPE else f"{CLOCK} is of type {kind}, {CLOCK_TYPE} is accepted."
