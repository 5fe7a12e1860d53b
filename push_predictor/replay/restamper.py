# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Header stamps of replayed messages, moved to the present by one constant offset."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable

from push_predictor.replay.clock import SECOND


class Restamper:
    """One offset for the whole replay: the first message gets the present time as its stamp."""

    def __init__(self, wall_time: Callable[[], int] = time.time_ns) -> None:
        self._wall_time = wall_time
        self.offset: int | None = None

    def settle(self, log_time: int) -> None:
        """Fix the offset if this is the first message."""
        if self.offset is None:
            self.offset = self._wall_time() - log_time

    def restamped(self, data: bytes) -> bytes:
        """The CDR data with a moved stamp; the message must begin with a header.

        Bytes 4 to 11 are its stamp, in the byte order that byte 1 gives. Raises struct.error if the data are too short.
        """
        order = "<" if data[1] & 1 else ">"
        seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, 4)
        stamp = divmod(seconds * SECOND + nanoseconds + (self.offset or 0), SECOND)
        return data[:4] + struct.pack(f"{order}iI", *stamp) + data[12:]
