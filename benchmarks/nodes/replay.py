# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Does a replay keep its rate and lose nothing? Compares received messages with recorded ones.

    python -m benchmarks.nodes.replay [--seconds 60] [--rate 1] [--depth 1000] [--rounds 1]

Simulates pushes with poses at 250 Hz and a wrench at 125 Hz, replays them with push_replay in a separate process and
subscribes here. --depth is that of the subscriber's queues, 0 keeps all messages. Prints what was received, and the
lateness that the node reports: p50 and p99 of each round, and their medians over the rounds.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile

from benchmarks.support.scripts import parser_of
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, simulate
from push_predictor.simulation.sensors import Sensors

TOPICS = {"/slider/pose": PoseStamped, "/pusher/pose": PoseStamped, "/pusher/wrench": WrenchStamped}
SECONDS_A_PUSH = 2.0  # at least, at 20 mm/s over 30 mm


def main() -> int:
    """Replay and compare; the exit status is 0 if every message of a replay arrived once, in order, unchanged."""
    options = _options()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", "78")
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "pushes"
        plan = random_pushes(int(options.seconds / SECONDS_A_PUSH) + 2, [0.02], 0.03, np.random.default_rng(0))
        sensors = Sensors(rate=250.0, wrench_rate=125.0)
        write_recording(bag, simulate(SimulationSpec("rect1", "abs", plan, sensors=sensors, name="pushes")))
        wrong, late = 0, list[tuple[float, float]]()
        for number in range(options.rounds):
            print(f"round {number + 1}: load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores", flush=True)
            with _subscribed(options.depth) as received:
                late.append(_replay(bag, options.rate, options.seconds))
            wrong += _compare(bag, received, options.seconds)
        p50, p99 = (statistics.median(values) for values in zip(*late, strict=True))
        print(f"medians over the rounds: late p50 {p50:.0f} us, p99 {p99:.0f} us")
        return 1 if wrong else 0


def _options() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of recorded time (default %(default)s)")
    parser.add_argument("--rate", type=float, default=1.0, help="of the replay (default %(default)s)")
    parser.add_argument("--rounds", type=int, default=1, help="number of replays (default %(default)s)")
    parser.add_argument("--depth", type=int, default=1000, help="of the subscriber's queues (default %(default)s)")
    return parser.parse_args()


@contextmanager
def _subscribed(depth: int) -> Iterator[dict[str, list[bytes]]]:
    """Subscribe to the three topics, raw; leaving waits until no more messages arrive."""
    rclpy.init()
    node, received = Node("subscriber"), {topic: list[bytes]() for topic in TOPICS}
    history = HistoryPolicy.KEEP_LAST if depth else HistoryPolicy.KEEP_ALL
    for topic, kind in TOPICS.items():
        node.create_subscription(
            kind, topic, received[topic].append, QoSProfile(depth=depth, history=history), raw=True
        )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=_spin, args=(executor,))
    thread.start()
    try:
        yield received
        before = -1
        while (count := sum(map(len, received.values()))) > before:
            before = count
            sleep(0.5)
    finally:
        executor.shutdown()
        thread.join()
        rclpy.try_shutdown()


def _spin(executor: SingleThreadedExecutor) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


def _replay(bag: Path, rate: float, seconds: float) -> tuple[float, float]:
    """The lateness that a replay reports at its end: p50 and p99, us."""
    parameters = {
        "recording": bag,
        "play.rate": rate,
        "play.playback_duration": seconds,
        "wait_for_subscribers": 15.0,
        "exit_when_finished": True,
    }
    assigned = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
    command = [sys.executable, "-m", "push_predictor.nodes.push_replay", "--ros-args", *assigned]
    printed = subprocess.run(command, check=True, stderr=subprocess.PIPE, text=True).stderr
    print(printed, end="", flush=True)
    (summary,) = re.findall(r"finished: .*", printed)
    (late,) = re.findall(r"p50 (\d+) us, p99 (\d+) us", summary)
    return float(late[0]), float(late[1])


def _compare(bag: Path, received: dict[str, list[bytes]], seconds: float) -> int:
    played = list(open_bag(bag).messages())
    end = min(message.log_time for message in played) + round(seconds * 1e9)
    wrong = 0
    for topic, messages in received.items():
        recorded = [bytes(m.data) for m in played if m.topic == topic and m.log_time <= end]
        same = [bytes(data) for data in messages] == recorded
        wrong += not same
        verdict = "each once, in order, unchanged" if same else "NOT as recorded"
        print(f"{topic:16s} recorded {len(recorded)}, received {len(messages)}: {verdict}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
