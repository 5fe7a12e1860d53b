# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Start-up time of the nodes, relative to an empty node.

    python -m benchmarks.nodes.start [--repeats 5] [--domain D]

A node is ready when a running node finds its service; the processor time that it takes until then and its memory are
printed too. `cold` has no table of the model on disk. All programs start in turns, so that they share the machine's
load, which is printed. Ratios are of the fastest starts: another node occasionally misses an announcement, and the next
one follows only after 3 s.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

from std_srvs.srv import Trigger

from benchmarks.nodes.server_under_test import caller, graph, load, process
from benchmarks.nodes.vitals import memory_of
from benchmarks.support.scripts import parser_of
from push_predictor_interfaces.srv import IsPaused, PredictPush

ROOT = Path(__file__).resolve().parents[2]
EMPTY = "empty node"
PATIENCE = 60.0  # s
_EMPTY_NODE = (
    "import rclpy; from std_srvs.srv import Trigger; "
    "rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO); node = rclpy.create_node('empty'); "
    "node.create_service(Trigger, 'empty', lambda q, a: a); rclpy.spin(node)"
)
MODEL, BAG = ROOT / "resource" / "simulated_square_abs.pushmodel", ROOT / "bags" / "hexagon_delrin"
SERVER = ("-m", "push_predictor.nodes.predict_server")
REPLAY = ("-m", "push_predictor.nodes.push_replay", "--ros-args", "-p", f"recording:={BAG}")
COLD = "predict_server, cold"
NODES = {
    EMPTY: (("-c", _EMPTY_NODE), Trigger, "empty"),
    "predict_server": (SERVER, PredictPush, "predict_push"),
    COLD: ((*SERVER, "--ros-args", "-p", "models:=['COPY']"), PredictPush, "predict_push"),
    "push_validator": (("-m", "push_predictor.nodes.push_validator"), Trigger, "push_validator/finish"),
    "push_replay": (REPLAY, IsPaused, "push_replay/is_paused"),
}


def main() -> int:
    """Measure and print."""
    parser = parser_of(__doc__)
    parser.add_argument("--repeats", type=int, default=5, help="of each (default %(default)s)")
    parser.add_argument("--domain", type=int, default=82, help="ROS domain to run in (default %(default)s)")
    options = parser.parse_args()
    starts = {name: list[tuple[float, float, float]]() for name in NODES}
    before = load()
    with graph(options.domain):
        for _ in range(options.repeats):
            for name, found in starts.items():
                found.append(_ready(name))
    fastest = min(starts[EMPTY])[0]
    for name, found in starts.items():
        ready, processor, memory = zip(*found, strict=True)
        times = f"{min(ready):6.2f} s, median {median(ready):.2f} s  {min(ready) / fastest:6.2f} x {EMPTY}"
        print(f"{name:22s} {times}, processor time {min(processor):.2f} s, memory {max(memory):.0f} MB")
    print(f"fastest of {options.repeats}; load average {before} before, {load()} after, {os.cpu_count()} cores")
    return 0


def _ready(name: str) -> tuple[float, float, float]:
    """Time until a node is ready, its processor time by then (s), and its memory (MB)."""
    arguments, kind, service = NODES[name]
    with caller() as asking, TemporaryDirectory(prefix="push_start_") as folder:
        copy = shutil.copy(MODEL, folder)
        client = asking.node.create_client(kind, service)
        begun = perf_counter()
        words = [word.replace("COPY", copy) for word in arguments]
        with process(*words, PUSH_PREDICTOR_CACHE=folder) as number:
            while not client.service_is_ready():  # wait_for_service looks every 0.25 s
                if perf_counter() > begun + PATIENCE:
                    raise SystemExit(f"{name}: no {client.srv_name} after {PATIENCE:g} s")
                sleep(0.005)
            return perf_counter() - begun, _processor_time(number), memory_of(number, "VmRSS")


def _processor_time(number: int) -> float:
    ticks = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    sys.exit(main())
