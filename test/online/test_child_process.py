# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The processes that a node starts."""

from __future__ import annotations

import multiprocessing
import os
import signal
from multiprocessing import util
from multiprocessing.connection import Connection
from typing import Any

import pytest

from push_predictor.error_codes import ErrorCode
from push_predictor.online.child_process import Child, Failure, kill_children


def report(connection: Connection) -> None:
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    connection.send((signal.SIGINT in blocked, signal.SIGTERM in blocked, os.environ["OPENBLAS_NUM_THREADS"]))
    connection.recv()


@pytest.mark.slow
def test_no_sigint_reaches_a_child_and_the_parent_still_gets_it() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    child = Child("report", report)
    child.start()
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before
    assert child.process is not None and child.process.daemon and child.process.name == "report"
    assert child.received(60.0) == (True, False, os.environ["OPENBLAS_NUM_THREADS"])
    kill_children()
    assert child.status(60.0) == -signal.SIGKILL
    reason = "the process of the report ended with signal 9 and no result, see the log of the node"
    assert child.received() == Failure(reason, ErrorCode.INTERNAL_ERROR)


def test_an_alarm_during_the_start_of_a_child_waits_until_the_child_has_its_data(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """It interrupts a node that starts too slowly. The child would end with a traceback, unknown to kill_children."""

    def begun_when_the_alarm_comes(*arguments: Any) -> int:
        pid: int = spawn(*arguments)
        signal.raise_signal(signal.SIGALRM)
        return pid

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    spawn, before = util.spawnv_passfds, signal.signal(signal.SIGALRM, interrupt)
    try:
        child = Child("report", report)
        child.start()  # with it the process that multiprocessing starts once
        monkeypatch.setattr(util, "spawnv_passfds", begun_when_the_alarm_comes)
        with pytest.raises(KeyboardInterrupt):
            child.start()  # ends the first one
        assert signal.getsignal(signal.SIGALRM) is interrupt
    finally:
        signal.signal(signal.SIGALRM, before)
    (interrupted,) = multiprocessing.active_children()
    kill_children()
    interrupted.join(60.0)
    assert "Traceback" not in capfd.readouterr().err
