# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`python coarse_node.py EXECUTABLE --ros-args ...` runs a node whose reports have coarse pictures.

So it is in the processes that it starts: multiprocessing runs this file in each of them, but for its end.
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from importlib import import_module

from coarse_pictures import coarse_pictures

from push_predictor.nodes.entry import install_handlers

ALL_THE_TIME = ExitStack()
ALL_THE_TIME.enter_context(coarse_pictures())

if __name__ == "__main__":
    install_handlers()
    sys.exit(import_module(f"push_predictor.nodes.{sys.argv.pop(1)}").main())
