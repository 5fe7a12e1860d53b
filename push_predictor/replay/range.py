"""Which part of a recording is played."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlayRange:
    """What to play, ns: offset from the first message; duration from there and until (a log time), None for no limit.

    Of two limits the later one counts, as in rosbag2.
    """

    offset: int = 0
    duration: int | None = None
    until: int | None = None

    def first(self, start: int) -> int:
        """Log time to begin at, of a source that starts at `start`."""
        return start + self.offset

    def last(self, start: int) -> int | None:
        """Log time to end at, inclusive."""
        ends = [self.until] if self.until is not None else []
        ends += [self.first(start) + self.duration] if self.duration is not None else []
        return max(ends, default=None)
