# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One replayed topic: serialized messages out, with flow control at high rates."""

from __future__ import annotations

import time

from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, ReliabilityPolicy

from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.flow_control import FlowControl
from push_predictor.replay.restamper import Restamper

_PARTS = 4  # of a history, timed one by one: a stall of the machine would make the whole history look slow
_FAST = 0.2  # s: if a part fills within this time, subscribers are waited for before the history overwrites


class TopicSender:
    """Publishes the messages of one topic. overwritten: messages that a subscriber may have lost to KEEP_LAST."""

    def __init__(self, publisher: Publisher, restamper: Restamper | None, flow_control: FlowControl) -> None:
        self.publisher = publisher
        self.overwritten = 0
        self._restamper, self._flow_control = restamper, flow_control
        profile = publisher.qos_profile
        bounded = profile.history == HistoryPolicy.KEEP_LAST and profile.reliability == ReliabilityPolicy.RELIABLE
        self._depth = profile.depth if bounded else 0
        self._part = max(1, self._depth // _PARTS)
        self._sent = 0  # since the last part
        self._unconfirmed = 0  # since the last wait, at most the depth of the history
        self._since = time.monotonic()

    def make_room(self) -> None:
        """At high rates, wait for subscribers before the history overwrites messages that they have not received."""
        if not self._depth or self._sent < self._part:
            return
        self._unconfirmed = min(self._unconfirmed + self._sent, self._depth)
        if time.monotonic() - self._since < _FAST and self._unconfirmed + self._part >= self._depth:
            if not self._flow_control.wait(self.publisher.topic_name, self.acknowledged):
                self.overwritten += self._unconfirmed
            self._unconfirmed = 0
        self._sent, self._since = 0, time.monotonic()

    def send(self, message: RawMessage) -> None:
        """Publish a message. Raises RCLError or struct.error if that is impossible."""
        if self._restamper is not None:
            self._restamper.settle(message.log_time)
            self.publisher.publish(self._restamper.restamped(message.data))
        else:
            self.publisher.publish(message.data)
        self._sent += 1

    def acknowledged(self) -> bool:
        """Whether every matched reliable subscriber has acknowledged everything."""
        # Always with timeout 0: the call keeps the interpreter lock, so a wait here would stop every thread.
        return bool(self.publisher.wait_for_all_acked(Duration(seconds=0)))
