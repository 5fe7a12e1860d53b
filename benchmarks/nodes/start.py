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

"""Start-up time of the nodes, relative to an empty node, and of the command line, relative to Python alone.

    python -m benchmarks.nodes.start [--repeats 5] [--domain D]

A node is ready when a running node finds its service; the processor time that it takes until then is printed too. All
programs start in turns, so that they share the machine's load, which is printed. Ratios are of the fastest starts:
another node occasionally misses an announcement, and the next one follows only after 3 s.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import perf_counter, sleep

from std_srvs.srv import Trigger

from benchmarks.nodes.server_under_test import caller, graph, load, process
from push_predictor_interfaces.srv import IsPaused, PredictPush

ROOT = Path(__file__).resolve().parents[2]
EMPTY = "empty node"
PATIENCE = 60.0  # s
_EMPTY_NODE = (
    "import rclpy; from std_srvs.srv import Trigger; "
    "rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO); node = rclpy.create_node('empty'); "
    "node.create_service(Trigger, 'empty', lambda q, a: a); rclpy.spin(node)"
)
NODES = {
    EMPTY: (("-c", _EMPTY_NODE), Trigger, "empty"),
    "predict_server": (("-m", "push_predictor.nodes.predict_server"), PredictPush, "predict_push"),
    "push_validator": (("-m", "push_predictor.nodes.push_validator"), Trigger, "push_validator/finish"),
    "push_replay": (
        (
            "-m",
            "push_predictor.nodes.push_replay",
            "--ros-args",
            "-p",
            f"recording:={ROOT / 'bags' / 'hexagon_delrin'}",
        ),
        IsPaused,
        "push_replay/is_paused",
    ),
}
PROGRAMS = {
    "python alone": ("-c", "pass"),
    "push_predictor --help": ("-m", "push_predictor.cli", "--help"),
}


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, help="of each (default %(default)s)")
    parser.add_argument("--domain", type=int, default=82, help="ROS domain to run in (default %(default)s)")
    options = parser.parse_args()
    taken: dict[str, list[float]] = {name: [] for name in (*NODES, *PROGRAMS)}
    worked: dict[str, list[float]] = {name: [] for name in NODES}
    before = load()
    with graph(options.domain):
        for _ in range(options.repeats):
            for name in NODES:
                ready, processor = _ready(name)
                taken[name].append(ready)
                worked[name].append(processor)
            for name, arguments in PROGRAMS.items():
                taken[name].append(_ended(arguments))
    _print(taken, EMPTY, list(NODES))
    print("processor time: " + ", ".join(f"{name} {min(worked[name]):.2f} s" for name in NODES))
    _print(taken, "python alone", list(PROGRAMS))
    print(f"fastest of {options.repeats}; load average {before} before, {load()} after, {os.cpu_count()} cores")
    return 0


def _ready(name: str) -> tuple[float, float]:
    """Time until a node is ready, and its processor time by then (s)."""
    arguments, kind, service = NODES[name]
    with caller() as asking:
        client = asking.node.create_client(kind, service)
        begun = perf_counter()
        with process(*arguments) as number:
            while not client.service_is_ready():  # wait_for_service looks every 0.25 s
                if perf_counter() > begun + PATIENCE:
                    raise SystemExit(f"{name}: no {client.srv_name} after {PATIENCE:g} s")
                sleep(0.005)
            return perf_counter() - begun, _processor_time(number)


def _processor_time(number: int) -> float:
    ticks = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def _ended(arguments: Sequence[str]) -> float:
    begun = perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    return perf_counter() - begun


def _print(taken: dict[str, list[float]], base: str, names: Sequence[str]) -> None:
    for name in names:
        ratio = min(taken[name]) / min(taken[base])
        print(f"{name:22s} {min(taken[name]):6.2f} s, median {median(taken[name]):.2f} s  {ratio:6.2f} x {base}")


if __name__ == "__main__":
    sys.exit(main())
