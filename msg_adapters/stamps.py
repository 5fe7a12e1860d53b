# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""builtin_interfaces/Time <-> integer nanoseconds."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time

from msg_adapters import MessageError

NANOSECONDS = 1_000_000_000
SECONDS_LIMIT = 2**31


def stamp_to_ns(stamp: Any) -> int:
    """Nanoseconds since the epoch of a Time, exact."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def ns_to_stamp(nanoseconds: int) -> Time:
    """The Time of integer nanoseconds. Raises MessageError outside the 32-bit seconds of the message."""
    sec, nanosec = divmod(int(nanoseconds), NANOSECONDS)
    if not -SECONDS_LIMIT <= sec < SECONDS_LIMIT:
        raise MessageError("stamp", nanoseconds, "nanoseconds within 32-bit seconds")
    return Time(sec=sec, nanosec=nanosec)
