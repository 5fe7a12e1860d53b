# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Messages that a publisher has sent but that did not arrive, by the numbers that the publisher gives them."""

from __future__ import annotations


class SequenceGaps:
    """Counts missing messages of one topic, as long as it has one publisher: several count independently."""

    def __init__(self) -> None:
        self._publishers = 0
        self._last: int | None = None

    def set_publishers(self, count: int) -> None:
        """State how many publishers there are now; another number starts the count again."""
        if count != self._publishers:
            self._publishers, self._last = count, None

    def missing(self, sequence: int | None) -> int:
        """How many messages are missing before the one with this number; None: the middleware gives no numbers."""
        before, self._last = self._last, sequence
        if before is None or sequence is None or self._publishers != 1:
            return 0
        return max(0, sequence - before - 1)
