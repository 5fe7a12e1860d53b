# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""PeriodicThread: it calls while everything else is busy, and after a call that failed."""

from __future__ import annotations

import time

from push_predictor.online.periodic_thread import PeriodicThread


def test_a_failed_call_is_reported_and_calls_go_on():
    calls, failures = [], []

    def work() -> None:
        calls.append(len(calls))
        if len(calls) == 1:
            raise ZeroDivisionError("a bug")

    periodic = PeriodicThread(0.01, work, failures.append)
    end = time.monotonic() + 10.0
    while len(calls) < 3 and time.monotonic() < end:
        time.sleep(0.01)
    periodic.stop()
    assert len(calls) >= 3
    assert [str(error) for error in failures] == ["a bug"]
    count = len(calls)
    time.sleep(0.05)
    assert len(calls) == count
