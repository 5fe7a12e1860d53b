# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The processes that a node starts."""

from __future__ import annotations

import os
import signal
from multiprocessing.connection import Connection

import pytest

from push_predictor.online.child_process import Child, kill_children


def report(connection: Connection) -> None:
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    connection.send((signal.SIGINT in blocked, signal.SIGTERM in blocked, os.environ["OPENBLAS_NUM_THREADS"]))
    connection.recv()


@pytest.mark.slow
def test_no_sigint_reaches_a_child_and_the_parent_still_gets_it() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    child = Child("report", report)
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before
    assert child.process.daemon and child.process.name == "report"
    assert child.received(60.0) == (True, False, os.environ["OPENBLAS_NUM_THREADS"])
    kill_children()
    child.process.join(60.0)
    assert child.process.exitcode == -signal.SIGKILL
    with pytest.raises(EOFError):
        child.received()
