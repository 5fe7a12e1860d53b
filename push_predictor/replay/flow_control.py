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
