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

"""Every entry limits BLAS to one thread by itself, unless the environment sets another number."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from repository import REPOSITORY

from push_predictor.blas_threads import VARIABLES

THREADS = """
def threads(*_):
    import numpy, scipy.linalg, threadpoolctl
    print({pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"})
    return 0
"""
NODE = """
import sys, types
from push_predictor.nodes import entry
sys.modules["push_predictor.nodes.{name}"] = types.SimpleNamespace(main=threads)
entry.{name}()
"""
COMMAND = """
import push_predictor.cli
push_predictor.cli.build_parser = threads
try:
    push_predictor.cli.main([])
except AttributeError:
    pass
"""
ENTRIES = {
    name: NODE.format(name=name) for name in ("predict_server", "push_recorder", "push_replay", "push_validator")
}


def printed(code: str, **given: str) -> str:
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    return subprocess.run(
        [sys.executable, "-c", THREADS + code],
        check=True,
        cwd=REPOSITORY,
        env={**environment, **given},
        stdout=subprocess.PIPE,
        text=True,
    ).stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize("entry", [*ENTRIES, "push_predictor"])
def test_an_entry_uses_one_thread(entry: str) -> None:
    assert printed({**ENTRIES, "push_predictor": COMMAND}[entry]) == "{1}"


@pytest.mark.slow
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="there is one processor")
def test_the_environment_may_ask_for_more() -> None:
    assert printed(ENTRIES["predict_server"], OPENBLAS_NUM_THREADS="2") == "{2}"
