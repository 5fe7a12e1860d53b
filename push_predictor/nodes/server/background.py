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
