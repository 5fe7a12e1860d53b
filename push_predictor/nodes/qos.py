# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""QoS of replayed topics and of subscriptions that follow their publishers; overrides in rosbag2's format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    InvalidQoSProfileException,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)

from push_predictor.errors import RequestError

DEPTH = 1000
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
KEPT = QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # for late subscribers
_POLICIES: Mapping[str, Any] = {
    "history": HistoryPolicy,
    "reliability": ReliabilityPolicy,
    "durability": DurabilityPolicy,
    "liveliness": LivelinessPolicy,
}
_DURATIONS = ("deadline", "lifespan", "liveliness_lease_duration")
_OTHERS: dict[str, Any] = {"depth": int, "avoid_ros_namespace_conventions": bool}
_KEYS = ", ".join([*_POLICIES, *_DURATIONS, *_OTHERS])
_PARAMETER = "play.qos_profile_overrides_path"


def replay_profile(recorded: str, kept: bool = False) -> QoSProfile:
    """The QoS of a replayed topic: reliable, KEEP_LAST.

    Durability is transient local if all recorded publishers had it (`recorded`: rosbag2's YAML text), or if messages
    are kept for late subscribers.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if kept or _was_latched(recorded) else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


def common_profile(publishers: Sequence[QoSProfile], depth: int = DEPTH, earlier: bool = True) -> QoSProfile:
    """The QoS that all publishers offer, reliable and volatile without any.

    earlier: ask for messages that were sent before, if all publishers keep them.
    """
    kept = earlier and all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in publishers)
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in publishers)
    return QoSProfile(
        depth=depth,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept and publishers else DurabilityPolicy.VOLATILE,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
    )


def read_overrides(path: Path | None) -> dict[str, dict[str, Any]]:
    """{topic without leading slash: {policy: value}} from a file. Raises RequestError that names file and key."""
    if path is None:
        return {}
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise RequestError(_PARAMETER, str(path), f"a YAML file ({error})") from None
    if not isinstance(content, dict) or not all(isinstance(v, dict) for v in content.values()):
        raise RequestError(_PARAMETER, str(path), "a YAML file of {topic: {policy: value}}")
    return {
        str(topic).strip("/"): {key: _value(f"{path}: {topic}: {key}", key, v) for key, v in policies.items()}
        for topic, policies in content.items()
    }


def overridden(profile: QoSProfile, overrides: Mapping[str, Any], topic: str) -> QoSProfile:
    """The profile with a topic's overrides. Raises RequestError if they are not valid."""
    try:
        for name, value in overrides.items():
            setattr(profile, name, value)
        return profile
    except (InvalidQoSProfileException, AssertionError, TypeError, ValueError) as error:
        raise RequestError(f"{_PARAMETER}: {topic}", dict(overrides), f"a QoS profile ({error})") from None


def _value(field: str, key: str, value: Any) -> Any:
    if key in _POLICIES:
        return _policy(field, _POLICIES[key], value)
    if key in _DURATIONS:
        if not isinstance(value, dict) or not all(type(value.get(part, 0)) is int for part in ("sec", "nsec")):
            raise RequestError(field, value, "{sec: integer, nsec: integer}")
        return Duration(seconds=value.get("sec", 0), nanoseconds=value.get("nsec", 0))
    if key not in _OTHERS:
        raise RequestError(field, value, f"one of the policies {_KEYS}")
    if type(value) is not _OTHERS[key] or value < 0:
        raise RequestError(field, value, "an integer from 0" if key == "depth" else "true or false")
    return value


def _policy(field: str, policy: Any, value: Any) -> Any:
    names = [name.lower() for name in policy.__members__ if name != "UNKNOWN"]
    name = str(value).lower()
    if name not in names:
        raise RequestError(field, value, " or ".join(names))
    return policy[name.upper()]


def _was_latched(recorded: str) -> bool:
    try:
        profiles = yaml.safe_load(recorded)
    except yaml.YAMLError:
        return False  # written by another tool; the default suits every subscriber except late ones
    if not isinstance(profiles, list) or not profiles:
        return False
    return all(isinstance(p, dict) and p.get("durability") in (1, "transient_local") for p in profiles)
