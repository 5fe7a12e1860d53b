# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every entry limits BLAS to one thread by itself, unless the environment sets another number."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from repository import REPOSITORY

from push_predictor.blas_threads import VARIABLES

NODES = ("predict_server", "push_recorder", "push_replay", "push_validator")
REPLACED = """
import os, sys, types
import push_predictor.cli
from push_predictor.nodes import entry

def begin(name):
    for variable in {variables}:
        os.environ.pop(variable, None)
    try:
        push_predictor.cli.main([]) if name == "push_predictor" else getattr(entry, name)()
    except AttributeError:  # of what stands in for the parser
        pass
"""
SETTINGS = """
def seen(*_):
    print("numpy" in sys.modules, *(os.environ.get(variable) for variable in {variables}))
    return 0

push_predictor.cli.build_parser = seen
for name in {nodes}:
    sys.modules[f"push_predictor.nodes.{{name}}"] = types.SimpleNamespace(main=seen)
for name in (*{nodes}, "push_predictor"):
    begin(name)
"""
THREADS = """
import types, sys
from push_predictor.nodes import entry

def threads():
    import numpy, scipy.linalg, threadpoolctl
    print({pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"})
    return 0

sys.modules["push_predictor.nodes.predict_server"] = types.SimpleNamespace(main=threads)
entry.predict_server()
"""


def printed(code: str, **given: str) -> list[str]:
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    return subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        cwd=REPOSITORY,
        env={**environment, **given},
        stdout=subprocess.PIPE,
        text=True,
    ).stdout.splitlines()


@pytest.mark.slow
def test_every_entry_asks_for_one_thread_before_numpy_is_loaded() -> None:
    code = (REPLACED + SETTINGS).format(variables=VARIABLES, nodes=NODES)
    assert printed(code) == ["False 1 1 1"] * (len(NODES) + 1)


@pytest.mark.slow
def test_blas_then_has_one_thread() -> None:
    assert printed(THREADS) == ["{1}"]


@pytest.mark.slow
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="there is one processor")
def test_the_environment_may_ask_for_more() -> None:
    assert printed(THREADS, OPENBLAS_NUM_THREADS="2") == ["{2}"]
