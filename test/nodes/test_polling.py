# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Subscriptions that a node polls: what its executor waits for."""

from __future__ import annotations

import pytest
from rclpy.context import Context
from rclpy.node import Node
from ros_harness import free_domain
from std_msgs.msg import String

from push_predictor.nodes import polling
from push_predictor.nodes.polling import PolledGroup


def test_executor_waits_for_events_once_a_second_and_never_for_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context, group = Context(), PolledGroup()
    context.init(args=[], domain_id=free_domain())
    node = Node("polling", context=context)
    try:
        polled = node.create_subscription(String, "text", lambda message: None, 10, callback_group=group)
        for now, waits in ((7.0, True), (7.02, True), (7.5, False), (7.99, False)):
            monkeypatch.setattr(polling, "monotonic", lambda now=now: now)
            assert not group.can_execute(polled)
            assert polled.event_handlers and {group.can_execute(event) for event in polled.event_handlers} == {waits}
    finally:
        node.destroy_node()
        context.try_shutdown()
