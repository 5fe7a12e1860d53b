# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""QoS and classes of the topics of a replay and of subscriptions that follow their publishers."""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence

import yaml
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from push_predictor.errors import PushPredictorError

DEPTH = 1000
DEEPEST = 5000  # the most that Fast DDS keeps: it rejects newer ones; memory grows as the queue fills
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
KEPT = QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # for late subscribers
CLOCK = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)  # as rosbag2 and Gazebo publish it
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Za-z][A-Za-z0-9]*)")


def replay_profile(recorded: str, kept: bool = False) -> QoSProfile:
    """The QoS of a replayed topic: reliable, KEEP_LAST.

    Durability is transient local if all recorded publishers had it (`recorded`: rosbag2's YAML text), or if messages
    are kept for late subscribers.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if kept or _was_latched(recorded) else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


def common_profile(publishers: Sequence[QoSProfile], earlier: bool = True) -> QoSProfile:
    """The QoS that all publishers offer, reliable and volatile without any.

    earlier: ask for messages that were sent before, if all publishers keep them.
    """
    kept = earlier and all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in publishers)
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in publishers)
    return QoSProfile(
        depth=DEEPEST,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept and publishers else DurabilityPolicy.VOLATILE,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
    )


def _was_latched(recorded: str) -> bool:
    try:
        profiles = yaml.safe_load(recorded)
    except yaml.YAMLError:
        return False  # written by another tool; the default suits every subscriber except late ones
    if not isinstance(profiles, list) or not profiles:
        return False
    return all(isinstance(p, dict) and p.get("durability") in (1, "transient_local") for p in profiles)


def message_class(kind: str) -> type:
    """The Python class of a message type such as std_msgs/msg/String. Raises PushPredictorError if there is none."""
    if not (match := _TYPE.fullmatch(kind)):
        raise PushPredictorError(f"type {kind!r} is not of the form package/msg/Name")
    try:
        found: type = getattr(importlib.import_module(f"{match[1]}.msg"), match[2])
    except (ImportError, AttributeError) as error:
        raise PushPredictorError(f"type {kind} is not installed ({error})") from None
    return found
