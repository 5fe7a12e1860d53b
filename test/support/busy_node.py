# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A small node that works for ever at one moment of its life; `python busy_node.py MOMENT --ros-args ...` runs it.

It prints what it does. moment: constructor, start, blocked (a start in one long call) or callback.
"""

from __future__ import annotations

import sys
import threading
import time

from rclpy.node import Node

from push_predictor.nodes import runtime
from push_predictor.nodes.entry import install_handlers
from push_predictor.nodes.runtime import Stop, run

runtime.LONGEST = 0.5  # s: the tests wait for it


class BusyNode(Node):
    def __init__(self, moment: str) -> None:
        super().__init__("busy")
        self._moment, self._closing = moment, threading.Event()
        threading.Thread(target=self._closing.wait).start()  # as push_replay has them
        if moment == "constructor":
            work()
        self.create_timer(0.01, work if moment == "callback" else lambda: None)

    def start(self) -> None:
        if self._moment == "start":
            work()
        if self._moment == "blocked":
            print("working", flush=True)
            time.sleep(1000.0)
        print("started", flush=True)

    def close(self) -> None:
        print("closed", flush=True)

    def destroy_node(self) -> None:
        self._closing.set()
        super().destroy_node()


def work() -> None:
    print("working", flush=True)
    try:
        while True:
            time.sleep(0.001)
    except Exception:
        print("caught", flush=True)


def make(stop: Stop) -> BusyNode:
    return BusyNode(sys.argv[1])


if __name__ == "__main__":
    install_handlers()
    sys.exit(run("busy", make, sys.argv[2:]))
