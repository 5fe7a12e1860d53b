"""Topics and services that a node asks for messages itself, in place of an executor's turn for every single one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from std_srvs.srv import Trigger


class PolledGroup(CallbackGroup):
    """Keeps an executor from waiting for subscriptions and services; their QoS events still get their turn."""

    def can_execute(self, entity: Any) -> bool:
        """See CallbackGroup."""
        return not isinstance(entity, (Subscription, Service))

    def beginning_execution(self, entity: Any) -> bool:
        """See CallbackGroup."""
        return self.can_execute(entity)

    def ending_execution(self, entity: Any) -> None:
        """See CallbackGroup."""


def take_all(subscription: Subscription) -> Iterator[tuple[Any, int, int]]:
    """What the middleware holds for a subscription: a tenth of the cost of an executor's turn.

    Each message comes with its publisher's count, and when it was sent (ns, by the publisher's clock).
    """
    with subscription.handle:
        while (taken := subscription.handle.take_message(subscription.msg_type, subscription.raw)) is not None:
            yield taken[0], taken[1]["publication_sequence_number"], taken[1]["source_timestamp"]


class DeferredTrigger:
    """A std_srvs/Trigger that is answered when its work is done, while the executor goes on with other things."""

    def __init__(self, node: Node, name: str) -> None:
        self._service = node.create_service(
            Trigger, name, lambda request, response: response, callback_group=PolledGroup()
        )
        self._callers: list[Any] = []

    def asked(self) -> bool:
        """Has anybody called who waits for the answer?"""
        with self._service.handle:
            while (taken := self._service.handle.service_take_request(Trigger.Request))[1] is not None:
                self._callers.append(taken[1])
        return bool(self._callers)

    def answer(self, success: bool, message: str) -> None:
        """Answer all who wait."""
        while self._callers:
            self._service.send_response(Trigger.Response(success=success, message=message), self._callers.pop())
