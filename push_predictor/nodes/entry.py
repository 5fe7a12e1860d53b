# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The start of a node process: signals and threads are settled before the imports of a node, which take half a second.

The console scripts and `python -m push_predictor.nodes.NAME` begin here. Import nothing at the top that takes time.
"""

from __future__ import annotations

import os
import signal
import sys
from functools import partial
from importlib import import_module

from push_predictor.blas_threads import limit_process
from push_predictor.errors import NotCompiledError


def install_handlers() -> None:
    """End the process at SIGINT or SIGTERM, with status 0, until nodes.runtime handles them.

    Python's own handler would print a traceback of the imports.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)


def run(node: str) -> int:
    """Run a node; returns the exit status."""
    install_handlers()
    limit_process()
    try:
        module = import_module(f"push_predictor.nodes.{node}")
    except NotCompiledError as error:
        print(f"{node}: {error}", file=sys.stderr)
        return 1
    status: int = module.main()
    return status


def _end(number: int, frame: object) -> None:
    os._exit(0)  # nothing to clean up: neither a node nor a child process exists yet


predict_server = partial(run, "predict_server")
push_recorder = partial(run, "push_recorder")
push_replay = partial(run, "push_replay")
push_validator = partial(run, "push_validator")
