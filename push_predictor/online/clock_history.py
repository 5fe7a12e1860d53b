# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The times on /clock, by which live messages without a header are dated.

push_replay publishes each such message's log time on /clock just before it, so the message gets the same stamp as when
the recording is read.
"""

from __future__ import annotations

import struct
from bisect import bisect_right

CLOCKS = 4000  # messages of /clock that are kept
DELAY = 1_000_000_000  # ns after sending a message within which its /clock arrives, if there is one
STALE = 5_000_000_000  # ns after the last message of a /clock without publisher, when its time expires


class ClockHistory:
    """The times published on /clock, by the time (ns) of their sending. published: whether it has a publisher."""

    def __init__(self) -> None:
        self.published = False
        self._sent: list[int] = []
        self._clock: list[int] = []

    def put(self, data: bytes, sent: int) -> None:
        """Add a message of /clock."""
        if len(data) < 12:  # of another type
            return
        seconds, rest = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
        self._sent.append(max(sent, self._sent[-1] if self._sent else 0))
        self._clock.append(seconds * 1_000_000_000 + rest)
        if len(self._sent) > CLOCKS:
            del self._sent[: CLOCKS // 2], self._clock[: CLOCKS // 2]

    def known_until(self, now: int) -> int:
        """The sending time (ns) up to which messages can be dated at a time."""
        return self._sent[-1] if self.published and self._sent else now - DELAY

    def at(self, sent: int) -> int | None:
        """The time (ns) published last before something was sent, None if it is not known.

        Without /clock, or long after its end, the time of sending itself.
        """
        if not self._sent or (not self.published and sent > self._sent[-1] + STALE):
            return sent
        place = bisect_right(self._sent, sent)
        return self._clock[place - 1] if place else None
