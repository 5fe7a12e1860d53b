# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Polled topics and services: the node takes messages itself, instead of one executor turn for each of them."""

from __future__ import annotations

from collections.abc import Iterator
from time import monotonic
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.service import Service
from rclpy.subscription import Subscription

EVENTS_PERIOD = 1.0  # s between two looks at the QoS events
EVENTS_TURN = 0.03  # s that a look lasts: longer than the period of the timers that keep the executor turning


class PolledGroup(CallbackGroup):
    """Keeps an executor from waiting for subscriptions and services; it handles their QoS events once a second.

    While an executor waits for the events of a subscription, each message that is not yet taken ends its wait: it would
    turn without a pause for as long as messages arrive.
    """

    def can_execute(self, entity: Any) -> bool:
        """See CallbackGroup."""
        return not isinstance(entity, (Subscription, Service)) and monotonic() % EVENTS_PERIOD < EVENTS_TURN

    def beginning_execution(self, entity: Any) -> bool:
        """See CallbackGroup."""
        return self.can_execute(entity)

    def ending_execution(self, entity: Any) -> None:
        """See CallbackGroup."""


class Taken(NamedTuple):
    """A message, its number (counted by the publisher), and when it was sent and received (ns)."""

    message: Any
    number: int
    sent: int
    received: int


def take_all(subscription: Subscription) -> Iterator[Taken]:
    """The messages that the middleware holds for a subscription, at a tenth of the cost of an executor's turn."""
    with subscription.handle:
        while (taken := subscription.handle.take_message(subscription.msg_type, subscription.raw)) is not None:
            message, info = taken
            number, sent = info["publication_sequence_number"], info["source_timestamp"]
            yield Taken(message, number, sent, info["received_timestamp"])
