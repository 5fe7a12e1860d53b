# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Flow control: how long a replay waits for subscribers before a publisher overwrites what they have not received."""

from __future__ import annotations

import time
from collections.abc import Callable

FIRST_TIMEOUT = 5.0  # s that the replay waits for the first topic that lags
RETRY_TIMEOUT = 0.25  # s for each further wait: several heartbeats of the middleware
RETRY_PERIOD = 1.0  # s between two waits for one topic: a subscriber that hangs must hardly delay the others
_POLL_PERIOD = 0.0002  # s


class FlowControl:
    """Waits long for the first topic that lags; briefly and seldom while any topic lags. ending: whether to give up."""

    def __init__(self, ending: Callable[[], bool]) -> None:
        self._ending = ending
        self._lagging: dict[str, float] = {}  # topic: time of the next wait, monotonic s

    def wait(self, topic: str, caught_up: Callable[[], bool]) -> bool:
        """Wait until the topic's subscribers have caught up, at most for the timeout; returns whether they have."""
        begin = time.monotonic()
        timeout = RETRY_TIMEOUT if self._lagging else FIRST_TIMEOUT
        if begin < self._lagging.get(topic, begin):
            timeout = 0.0
        while not (done := caught_up()) and time.monotonic() - begin < timeout and not self._ending():
            time.sleep(_POLL_PERIOD)
        if done:
            self._lagging.pop(topic, None)
        elif timeout:
            self._lagging[topic] = time.monotonic() + RETRY_PERIOD
        return done
