# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The QoS of several publishers is what all of them offer."""

from __future__ import annotations

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from push_predictor.nodes.qos import common_profile, replay_profile

VOLATILE, LATCHED = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL


@pytest.mark.parametrize(
    ("offered", "common"),
    [([], VOLATILE), ([LATCHED, LATCHED], LATCHED), ([LATCHED, VOLATILE], VOLATILE), ([VOLATILE, LATCHED], VOLATILE)],
)
def test_earlier_messages_are_asked_for_if_every_publisher_keeps_them(
    offered: list[DurabilityPolicy], common: DurabilityPolicy
) -> None:
    publishers = [QoSProfile(depth=1, durability=each) for each in offered]
    assert common_profile(publishers).durability == common
    assert common_profile(publishers, earlier=False).durability == VOLATILE
    recorded = str([{"durability": each.name.lower()} for each in offered])
    assert replay_profile(recorded).durability == common


def test_one_best_effort_publisher_makes_the_subscription_best_effort() -> None:
    policies = (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT)
    publishers = [QoSProfile(depth=1, reliability=policy) for policy in policies]
    assert common_profile(publishers).reliability == ReliabilityPolicy.BEST_EFFORT
    assert common_profile(publishers[:0]).reliability == ReliabilityPolicy.RELIABLE
