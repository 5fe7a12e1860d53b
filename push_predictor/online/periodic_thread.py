# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A periodic call in a thread of its own, on time while the executor is busy."""

from __future__ import annotations

import threading
from collections.abc import Callable


class PeriodicThread:
    """Calls `work` every `period` s of wall time until `stop`; an exception goes to `failed`, and the calls go on."""

    def __init__(self, period: float, work: Callable[[], None], failed: Callable[[Exception], None]) -> None:
        self._period, self._work, self._failed = period, work, failed
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="periodic", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Make no more calls; wait for one that runs."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stopping.wait(self._period):
            try:
                self._work()
            except Exception as error:  # one failed call must not be the last
                self._failed(error)
