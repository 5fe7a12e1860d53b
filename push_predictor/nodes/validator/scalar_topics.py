# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The live scalar topics: subscribed when they appear; messages without a header are dated by /clock."""

from __future__ import annotations

import struct
import sys
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import replace
from time import time_ns

import numpy as np
from rclpy.node import Node

from push_predictor.nodes.polling import ONE_TYPE, FollowingSubscription, Taken
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


class ScalarTopics:
    """Moves the messages of scalar topics into inputs, by name of the scalar.

    Call `look` and `date` in the executor's thread, `move` in any, one at a time.
    """

    def __init__(self, node: Node, inputs: Mapping[str, TopicInput]) -> None:
        self._streams = {name: TopicStream(node, own, earlier=True) for name, own in inputs.items()}
        self._undated: dict[str, list[Taken]] = {name: [] for name in inputs}
        self._ticks, self._clock = FollowingSubscription(node, CLOCK, _no_clock), ClockHistory()

    def look(self) -> None:
        """Subscribe to topics that have appeared."""
        for stream in self._streams.values():
            stream.look()
        if self._streams:
            self._ticks.look()
        self._clock.published = bool(self._ticks.offered)

    def move(self) -> None:
        """Move arrived messages from the middleware."""
        for name, stream in self._streams.items():
            if stream.input.timed:
                stream.move()
            else:
                self._undated[name] += stream.subscription.taken()
                del self._undated[name][:-LIMIT]
        for tick in self._ticks.taken():
            self._clock.put(tick.message, tick.sent)

    def date(self, last: bool = False) -> None:
        """Date the messages whose time on /clock is known by now; last: all."""
        until = sys.maxsize if last else self._clock.known_until(time_ns())
        for name, waiting in self._undated.items():
            due = [message for message in waiting if message.sent < until]
            self._undated[name] = [message for message in waiting if message.sent >= until]
            own, times = self._streams[name].input, [self._clock.at(message.sent) for message in due]
            dated = [message for message, time in zip(due, times, strict=True) if time is not None]
            if len(dated) < len(due):
                own.received += len(due) - len(dated)
                own.rejected["without time"] += len(due) - len(dated)
            if dated:
                messages, arrived = as_messages(dated, own.source.topic, own.kind)
                known = np.array([time for time in times if time is not None], np.int64)
                own.put(replace(messages, times=known), arrived)

    def waiting(self) -> bool:
        """Whether messages of every published topic wait."""
        return all(
            len(stream.input) or self._undated[name] for name, stream in self._streams.items() if stream.input.kind
        )

    def figures(self) -> dict[str, object]:
        """Counts of messages by topic; rejected ones also by kind, for the kinds that occurred."""
        found: dict[str, object] = {}
        for name, stream in self._streams.items():
            if stream.input.kind:
                found[f"topic:{name} samples"] = stream.input.received + len(self._undated[name])
                found |= {f"topic:{name} rejected {kind}": count for kind, count in stream.input.rejected.items()}
        return found

    def problems(self) -> list[str]:
        """In words, which topics have no samples, and which samples of the others were rejected."""
        found = []
        for name, stream in self._streams.items():
            topic, rejected = stream.subscription, stream.input.rejected
            if topic.problem == ONE_TYPE:
                types = ", ".join(topic.kinds)
                found.append(f"Scalar topic {name} has publishers of the types {types}. One type is accepted.")
            elif topic.problem:
                found.append(f"{topic.problem.removesuffix('.')}.")
            elif not stream.input.kind:
                found.append(f"Scalar topic {name} has no publisher.")
            elif rejected:
                by_kind = ", ".join(f"{kind} {count}" for kind, count in rejected.items())
                found.append(f"{name}: {rejected.total()} samples were rejected ({by_kind}).")
        return found


def _no_clock(kind: str) -> str:
    return "" if kind == CLOCK_TYPE else f"{CLOCK} is of type {kind}, {CLOCK_TYPE} is accepted."
