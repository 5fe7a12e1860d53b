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

"""The processes that a node starts."""

from __future__ import annotations

import multiprocessing
import os
import signal
from multiprocessing.connection import Connection

import pytest

from push_predictor.online.child_process import kill_children, start_child


def report(connection: Connection) -> None:
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    connection.send((signal.SIGINT in blocked, signal.SIGTERM in blocked, os.environ["OPENBLAS_NUM_THREADS"]))
    connection.recv()


@pytest.mark.slow
def test_no_sigint_reaches_a_child_and_the_parent_still_gets_it() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    ours, theirs = multiprocessing.Pipe()
    child = start_child(report, (theirs,), "report")
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before
    assert child.daemon and child.name == "report"
    assert ours.recv() == (True, False, os.environ["OPENBLAS_NUM_THREADS"])
    kill_children()
    child.join(60.0)
    assert child.exitcode == -signal.SIGKILL
