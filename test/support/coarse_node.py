# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`python coarse_node.py EXECUTABLE --ros-args ...` runs a node whose reports have charts, but empty pictures.

So it is in the processes that it starts: multiprocessing runs this file in each of them, but for its end.
"""

from __future__ import annotations

import sys
from contextlib import ExitStack
from importlib import import_module
from unittest.mock import patch

from push_predictor.nodes.entry import install_handlers
from push_predictor.reporting import canvas

ALL_THE_TIME = ExitStack()
ALL_THE_TIME.enter_context(patch.object(canvas, "draw", lambda path, *_: path.write_bytes(b"")))

if __name__ == "__main__":
    install_handlers()
    node = import_module(f"push_predictor.nodes.{sys.argv.pop(1)}")
    if node.__name__.endswith("push_validator"):
        ALL_THE_TIME.enter_context(patch("push_predictor.online.alarm_process.AlarmProcess.prepare"))
        ALL_THE_TIME.enter_context(patch("push_predictor.online.check_process.FIRST", sys.maxsize))
    sys.exit(node.main())
