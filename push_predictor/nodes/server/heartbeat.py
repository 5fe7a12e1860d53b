"""Something done once a period from a thread of its own: also while the executor is at a long answer."""

from __future__ import annotations

import threading
from collections.abc import Callable


class Heartbeat:
    """Calls `beat` every `period` s of wall time until it is ended; an error of `beat` goes to `failed`."""

    def __init__(self, period: float, beat: Callable[[], None], failed: Callable[[Exception], None]) -> None:
        self._period, self._beat, self._failed = period, beat, failed
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """No more beats from now on."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ending.wait(self._period):
            try:
                self._beat()
            except Exception as error:  # one beat that fails must not be the last
                self._failed(error)
