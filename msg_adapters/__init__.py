# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Conversion between ROS messages and the library's own types: pure functions, without state or node.

Reading accepts rclpy messages and any object with the same fields, such as rosbags and mcap decoders return;
writing returns rclpy messages. This module has what all of them use.
"""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time

from push_predictor.errors import PushPredictorError

NANOSECONDS = 1_000_000_000
SECONDS_LIMIT = 2**31


class MessageError(PushPredictorError):
    """A message contains a value that is not accepted; the text names the field, the value and what is accepted."""

    def __init__(self, field: str, value: object, accepted: str) -> None:
        super().__init__(f"{field}: {value!r} is not accepted, give {accepted}")
        self.field = field


def stamp_to_ns(stamp: Any) -> int:
    """Nanoseconds since the epoch of a Time, exact."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def ns_to_stamp(nanoseconds: int) -> Time:
    """The Time of integer nanoseconds. Raises MessageError outside the 32-bit seconds of the message."""
    sec, nanosec = divmod(int(nanoseconds), NANOSECONDS)
    if not -SECONDS_LIMIT <= sec < SECONDS_LIMIT:
        raise MessageError("stamp", nanoseconds, "nanoseconds within 32-bit seconds")
    return Time(sec=sec, nanosec=nanosec)
