# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A subscriber in a process of its own: it stores the raw messages of some topics until a signal.

python replay_listener.py OUTPUT DEPTH TOPIC=TYPE...    writes a pickle {topic: [bytes, ...]} on SIGINT
"""

from __future__ import annotations

import functools
import pickle
import signal
import sys
import threading
import time
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

from push_predictor.nodes.qos import message_class


def main(output: str, depth: str, *topics: str) -> None:
    """Subscribe; depth 0 keeps all messages."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    ended = threading.Event()
    signal.signal(signal.SIGINT, lambda number, frame: ended.set())
    node = Node("listener")
    history = HistoryPolicy.KEEP_LAST if int(depth) else HistoryPolicy.KEEP_ALL
    heard: dict[str, list[bytes]] = {}
    for pair in topics:
        topic, kind = pair.split("=")
        heard[topic] = []
        profile = QoSProfile(depth=int(depth), history=history)
        callback = functools.partial(_keep, heard[topic])
        node.create_subscription(message_class(kind), topic, callback, profile, raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinner = threading.Thread(target=executor.spin)
    spinner.start()
    while not ended.is_set():  # a handler may not interrupt a wait on its own event
        time.sleep(0.05)
    while _still_receiving(heard):
        pass
    executor.shutdown()
    spinner.join()
    Path(output).write_bytes(pickle.dumps(heard))
    rclpy.try_shutdown()


def _still_receiving(heard: dict[str, list[bytes]]) -> bool:
    """Whether a message has arrived within two seconds: Python reads DDS's backlog slowly."""
    before = sum(map(len, heard.values()))
    time.sleep(2.0)
    return sum(map(len, heard.values())) > before


def _keep(heard: list[bytes], data: bytes) -> None:
    heard.append(bytes(data))


if __name__ == "__main__":
    main(*sys.argv[1:])
