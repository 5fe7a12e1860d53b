"""How long a replay waits for subscribers that have not got what a publisher is about to overwrite."""

from __future__ import annotations

import time
from collections.abc import Callable

LONG = 5.0  # s that the replay is held up before a subscriber is left behind
AGAIN = 0.25  # s, some heartbeats: so long it is waited for then
PAUSE = 1.0  # s between two such times, so that a subscriber that hangs hardly holds up the others
_LOOK = 0.0002  # s between two looks


class Patience:
    """Long once, for the first topic that lags; briefly and seldom while any is left behind. ending: is the replay?"""

    def __init__(self, ending: Callable[[], bool]) -> None:
        self._ending = ending
        self._left_behind: dict[str, float] = {}  # topic: when it is waited for again, monotonic s

    def wait(self, topic: str, caught_up: Callable[[], bool]) -> bool:
        """Wait until its subscribers have caught up, or patience or the replay ends; answers whether they have."""
        begin = time.monotonic()
        patience = AGAIN if self._left_behind else LONG
        if begin < self._left_behind.get(topic, begin):
            patience = 0.0
        while not (done := caught_up()) and time.monotonic() - begin < patience and not self._ending():
            time.sleep(_LOOK)
        if done:
            self._left_behind.pop(topic, None)
        elif patience:
            self._left_behind[topic] = time.monotonic() + PAUSE
        return done
