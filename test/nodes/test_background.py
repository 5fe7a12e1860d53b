# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Work in the background: of low priority, and no exception is lost."""

from __future__ import annotations

import os
import sys
import threading

import pytest

from push_predictor.nodes.server.background import NICENESS, in_background


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has priorities of single threads")
def test_work_runs_at_low_priority_and_leaves_that_of_others() -> None:
    before, found = os.getpriority(os.PRIO_PROCESS, 0), []

    def work() -> None:
        found.append((threading.current_thread().daemon, os.getpriority(os.PRIO_PROCESS, threading.get_native_id())))

    in_background(work, pytest.fail).join(10.0)
    assert found == [(True, NICENESS)] and os.getpriority(os.PRIO_PROCESS, 0) == before


def test_an_exception_is_reported() -> None:
    failed: list[Exception] = []

    def work() -> None:
        raise ValueError("no table")

    in_background(work, failed.append).join(10.0)
    assert [str(error) for error in failed] == ["no table"]
