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

"""The part of a recording to play."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlayRange:
    """The part to play, in ns: offset from the first message, duration from there, until (a log time).

    A limit of None is no limit. Of two limits the later one applies, as in rosbag2.
    """

    offset: int = 0
    duration: int | None = None
    until: int | None = None

    def first(self, start: int) -> int:
        """Log time of the beginning, for a source that starts at `start`."""
        return start + self.offset

    def last(self, start: int) -> int | None:
        """Log time of the end, inclusive; None for no limit."""
        ends = [self.until] if self.until is not None else []
        ends += [self.first(start) + self.duration] if self.duration is not None else []
        return max(ends, default=None)
