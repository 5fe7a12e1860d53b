# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Work in a thread of low priority, which requests do not wait for."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress

NICENESS = 10  # of 19: what answers requests comes first


def in_background(work: Callable[[], None], failed: Callable[[Exception], None]) -> threading.Thread:
    """Start the work in a thread that does not keep the process alive; an exception goes to `failed`."""

    def run() -> None:
        with suppress(OSError, AttributeError):  # Linux has a priority for each thread, others for the process
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
        try:
            work()
        except Exception as error:
            failed(error)

    thread = threading.Thread(target=run, name="background", daemon=True)
    thread.start()
    return thread
