# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
