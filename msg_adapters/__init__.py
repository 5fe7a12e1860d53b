# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Conversion between ROS messages and the library's own types: pure functions, without state or node.

Reading accepts rclpy messages and any object with the same fields, such as rosbags and mcap decoders return;
writing returns rclpy messages. This module has what all of them use.
"""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time

from push_predictor.errors import RequestError

NANOSECONDS = 1_000_000_000
SECONDS_LIMIT = 2**31


def stamp_to_ns(stamp: Any) -> int:
    """Nanoseconds since the epoch of a Time, exact."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def ns_to_stamp(nanoseconds: int) -> Time:
    """The Time of integer nanoseconds. Raises RequestError outside the 32-bit seconds of the message."""
    sec, nanosec = divmod(int(nanoseconds), NANOSECONDS)
    if not -SECONDS_LIMIT <= sec < SECONDS_LIMIT:
        raise RequestError("stamp", nanoseconds, "nanoseconds within 32-bit seconds")
    return Time(sec=sec, nanosec=nanosec)
