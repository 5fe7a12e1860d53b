# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

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
