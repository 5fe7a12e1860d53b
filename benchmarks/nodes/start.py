# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Start-up time of the nodes, relative to an empty node, and of the command line, relative to Python alone.

    python -m benchmarks.nodes.start [--repeats 5] [--domain D]

A node is ready when a running node finds its service; the processor time that it takes until then and its memory are
printed too. `cold` has no table of the model on disk. The parts of the server's start are programs that do ever more of
it. The last lines compare each entry without and with OPENBLAS_NUM_THREADS=1. All programs start in turns, so that they
share the machine's load, which is printed. Ratios are of the fastest starts: another node occasionally misses an
announcement, and the next one follows only after 3 s.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

from std_srvs.srv import Trigger

from benchmarks.nodes.server_under_test import caller, environment_of, graph, load, process
from push_predictor_interfaces.srv import IsPaused, PredictPush

ROOT = Path(__file__).resolve().parents[2]
EMPTY = "empty node"
PATIENCE = 60.0  # s
_EMPTY_NODE = (
    "import rclpy; from std_srvs.srv import Trigger; "
    "rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO); node = rclpy.create_node('empty'); "
    "node.create_service(Trigger, 'empty', lambda q, a: a); rclpy.spin(node)"
)
MODEL = ROOT / "resource" / "simulated_square_abs.pushmodel"
SERVER = ("-m", "push_predictor.nodes.predict_server")
COLD = "predict_server, cold"
NODES = {
    EMPTY: (("-c", _EMPTY_NODE), Trigger, "empty"),
    "predict_server": (SERVER, PredictPush, "predict_push"),
    COLD: ((*SERVER, "--ros-args", "-p", "models:=['COPY']"), PredictPush, "predict_push"),
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


_ROS = "import rclpy; rclpy.init(); rclpy.create_node('part')\n"
_OURS = (
    "from push_predictor.blas_threads import limit_process; limit_process()\n"
    "import push_predictor.nodes.predict_server\n"
)
_LOAD = "from pathlib import Path; from push_predictor.models.store"
_PARTS = {
    "interpreter": "pass",
    "rclpy and a node": _ROS,
    "own imports": _ROS + _OURS,
    "model": f"{_ROS}{_OURS}{_LOAD}.model_file import load_model; load_model({str(MODEL)!r}, check=False)",
    "table": f"{_ROS}{_OURS}{_LOAD}.table_cache import load_served; load_served(Path({str(MODEL)!r}))",
}
_EXACT = (
    "import numpy as np; from push_predictor import load_model\n"
    f"model = load_model({str(MODEL)!r}); rows = model.training.take(np.arange(100))\n"
    "for _ in range(10): model.predict_rows(rows.inputs, rows.duration)"
)
_ROLLOUT = (
    "import numpy as np; from push_predictor import load_model; from push_predictor.planning.rollout import rollout\n"
    f"rollout(load_model({str(MODEL)!r}), np.zeros(3), 1e-8 * np.eye(3), np.array([[0.02, 0.1, 0.0, 0.2]] * 3), 100)"
)
_TRAINING = (
    "import numpy as np; from push_predictor import load_model; from push_predictor.models.train import train_model\n"
    f"model = load_model({str(MODEL)!r}); rows = model.training.take(np.arange(300))\n"
    "train_model(rows, model.rig, 'gp', name='gp')"
)
ENTRIES = {
    "1000 exact predictions, library": _EXACT,
    "a rollout, library": _ROLLOUT,
    "training, library": _TRAINING,
}


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, help="of each (default %(default)s)")
    parser.add_argument("--domain", type=int, default=82, help="ROS domain to run in (default %(default)s)")
    options = parser.parse_args()
    taken: dict[str, list[float]] = {name: [] for name in (*NODES, *PROGRAMS)}
    worked: dict[str, list[float]] = {name: [] for name in (*NODES, *_PARTS)}
    memory: dict[str, list[float]] = {name: [] for name in NODES}
    threads: dict[str, list[tuple[float, float]]] = {name: [] for name in (COLD, *ENTRIES)}
    before = load()
    with graph(options.domain):
        for _ in range(options.repeats):
            for name in NODES:
                ready, processor, size = _ready(name)
                taken[name].append(ready)
                worked[name].append(processor)
                memory[name].append(size)
            limited = _ready(COLD, OPENBLAS_NUM_THREADS="1")
            threads[COLD].append((taken[COLD][-1] / limited[0], worked[COLD][-1] / limited[1]))
            for name, arguments in PROGRAMS.items():
                taken[name].append(_ended(arguments)[0])
            for name, code in _PARTS.items():
                worked[name].append(_ended(("-c", code))[1])
            for name, code in ENTRIES.items():
                free, one = _ended(("-c", code)), _ended(("-c", code), OPENBLAS_NUM_THREADS="1")
                threads[name].append((free[0] / one[0], free[1] / one[1]))
    _print(taken, EMPTY, list(NODES))
    for name in NODES:
        print(f"{name:22s} processor time {min(worked[name]):.2f} s, memory {max(memory[name]):.0f} MB")
    _print_parts(worked)
    _print(taken, "python alone", list(PROGRAMS))
    for name, ratios in threads.items():
        wall, processor = (median(ratio[k] for ratio in ratios) for k in (0, 1))
        print(f"{name}: without OPENBLAS_NUM_THREADS {wall:.2f} x the time, {processor:.2f} x the processor time")
    print(f"fastest of {options.repeats}; load average {before} before, {load()} after, {os.cpu_count()} cores")
    return 0


def _ready(name: str, **given: str) -> tuple[float, float, float]:
    """Time until a node is ready, its processor time by then (s), and its memory (MB). given: environment."""
    arguments, kind, service = NODES[name]
    with caller() as asking, TemporaryDirectory(prefix="push_start_") as folder:
        copy = shutil.copy(MODEL, folder)
        client = asking.node.create_client(kind, service)
        begun = perf_counter()
        words = [word.replace("COPY", copy) for word in arguments]
        with process(*words, PUSH_PREDICTOR_CACHE=folder, **given) as number:
            while not client.service_is_ready():  # wait_for_service looks every 0.25 s
                if perf_counter() > begun + PATIENCE:
                    raise SystemExit(f"{name}: no {client.srv_name} after {PATIENCE:g} s")
                sleep(0.005)
            return perf_counter() - begun, _processor_time(number), _memory(number)


def _processor_time(number: int) -> float:
    ticks = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def _memory(number: int) -> float:
    lines = Path(f"/proc/{number}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024.0


def _ended(arguments: Sequence[str], **given: str) -> tuple[float, float]:
    """Time and processor time (s) of a program."""
    before, begun = os.times(), perf_counter()
    command = [sys.executable, *arguments]
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL, env=environment_of(**given))
    after = os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return perf_counter() - begun, used


def _print_parts(worked: dict[str, list[float]]) -> None:
    before = 0.0
    for name in _PARTS:
        print(f"part of a start: {name:18s} {min(worked[name]) - before:5.2f} s of processor time")
        before = min(worked[name])


def _print(taken: dict[str, list[float]], base: str, names: Sequence[str]) -> None:
    for name in names:
        ratio = min(taken[name]) / min(taken[base])
        print(f"{name:22s} {min(taken[name]):6.2f} s, median {median(taken[name]):.2f} s  {ratio:6.2f} x {base}")


if __name__ == "__main__":
    sys.exit(main())
