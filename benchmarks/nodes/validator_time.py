# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Processor time of push_validator while a recording is replayed, of this code and of another checkout in turns.

    python -m benchmarks.nodes.validator_time [--other CHECKOUT] [--rounds 3] [--rate 10] [--recording BAG] [--domain D]

push_replay and predict_server are of the same checkout as the validator. What counts is the time from the start of the
replay until the result is written, without the start of the node and without its child processes.
"""

from __future__ import annotations

import argparse
import os
import signal
import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from time import monotonic, sleep

from benchmarks.nodes.server_under_test import load
from benchmarks.support.scripts import parser_of
from push_predictor.resources import DEFAULT_MODEL

ROOT = Path(__file__).resolve().parents[2]
RECORDING = ROOT / "bags" / "square_abs_test"
STARTING, PATIENCE = 8.0, 300.0  # s


def main() -> int:
    """Measure the checkouts in turns, print each round and the ratio of the medians."""
    options = _options()
    checkouts = [ROOT, *([options.other] if options.other else [])]
    seconds: dict[Path, list[float]] = {checkout: [] for checkout in checkouts}
    for _ in range(options.rounds):
        for checkout in checkouts:
            seconds[checkout].append(_measured(checkout, options))
            print(f"{checkout}: {seconds[checkout][-1]:.2f} s of processor time; load {load()}", flush=True)
    medians = [statistics.median(times) for times in seconds.values()]
    print(f"medians {', '.join(f'{median:.2f} s' for median in medians)}")
    if options.other:
        print(f"this code / {options.other}: {medians[0] / medians[1]:.2f}")
    return 0


def _measured(checkout: Path, options: argparse.Namespace) -> float:
    """Seconds of processor time of the validator of a checkout."""
    model = checkout.joinpath(*DEFAULT_MODEL)
    with ExitStack() as stack:
        output = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="push_validator_time_")))
        _start(stack, checkout, options.domain, "predict_server", {"models": f"[{model}]"})
        validating = {"model": model, "output": output, "report": "false"}
        validator = _start(stack, checkout, options.domain, "push_validator", validating)
        sleep(STARTING)
        begin, until = _processor_time(validator), monotonic() + PATIENCE
        playing = {"recording": options.recording, "play.rate": options.rate, "wait_for_subscribers": 60.0}
        _start(stack, checkout, options.domain, "push_replay", playing)
        while not (output / "validation.json").exists():
            if monotonic() > until:
                raise SystemExit(f"{checkout}: no validation within {PATIENCE:.0f} s")
            sleep(0.1)
        return _processor_time(validator) - begin


def _start(stack: ExitStack, checkout: Path, domain: int, node: str, given: dict[str, object]) -> int:
    """Start a node of a checkout until the stack is left; returns the number of its process."""
    words = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
    environment = {**os.environ, "PYTHONPATH": str(checkout), "ROS_DOMAIN_ID": str(domain)}
    environment |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "OPENBLAS_NUM_THREADS": "1"}
    child = subprocess.Popen(
        [sys.executable, "-m", f"push_predictor.nodes.{node}", "--ros-args", *words],
        cwd=checkout,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    stack.callback(child.wait, 60.0)
    stack.callback(child.send_signal, signal.SIGTERM)
    return child.pid


def _processor_time(process: int) -> float:
    """Seconds of processor time of a process so far, in user and kernel mode."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _options() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--other", type=Path, help="folder of another checkout, with its compiled modules")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rate", type=float, default=10.0, help="recorded seconds per second")
    parser.add_argument("--recording", type=Path, default=RECORDING)
    parser.add_argument("--domain", type=int, default=79)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
