# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Many clients of one predict_server for a long time: response times, lost requests, growth of the server.

    python -m benchmarks.nodes.load [--clients 50] [--minutes 10] [--rate 5] [--domain D]

Fifty clients, ten per process and each with its own node, request single pushes from the shipped model and, every tenth
time, a batch of a hundred. Two more clients send requests and take no response: one never reads (`deaf`), one is
stopped as by Ctrl-Z (`stopped`). A request without a response within 5 s is a timeout; `lost` are requests with neither
a response nor a timeout. The exit status is 1 if a request was lost, refused or answered wrongly, or if the server's
memory grew by more than 5 MB after a minute.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np

from benchmarks.nodes.load_client import MANY, SINGLE, TIMEOUT
from benchmarks.nodes.server_under_test import caller, graph, load, predict_server
from benchmarks.nodes.vitals import Growth, Vitals, growth, vitals
from benchmarks.support.scripts import parser_of
from push_predictor.resources import DEFAULT_MODEL, share_path

A_PROCESS = 10  # clients per process; with one process each, localhost discovery would miss some
WARM_UP = 60.0  # s
MOST_GROWTH = 5.0  # MB


def main() -> int:
    """Run the clients, print the result; the exit status is 1 after a failure."""
    options = _options()
    os.environ.update(ROS_DOMAIN_ID=str(options.domain), ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
    seconds, before = options.minutes * 60.0, load()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="push_load_")))
        server = stack.enter_context(predict_server(share_path(*DEFAULT_MODEL)))
        counts = [min(A_PROCESS, options.clients - first) for first in range(0, options.clients, A_PROCESS)]
        groups: list[tuple[str, ...]] = [("--deaf",), ("--stopped",)]
        groups += [("--clients", f"{count}", "--seed", f"{k + 1}") for k, count in enumerate(counts)]
        common = ("--seconds", f"{seconds}", "--rate", f"{options.rate}")
        files = [folder / f"{k}.json" for k in range(len(groups))]
        running = [stack.enter_context(_clients(f, *common, *g)) for f, g in zip(files, groups, strict=True)]
        for process in running:
            assert process.stdout is not None
            while process.stdout.readline() not in (b"asking\n", b""):  # skip lines of the middleware
                pass
        seen = _watched(server, running[2:], options.every)
        served = _served(stack)
        accounts = [account for file in files[2:] for account in json.loads(file.read_text())]
    print(f"{options.clients} clients, {seconds:g} s; load average {before} before, {load()} after, two cores")
    print(f"the server reports that it answered {served}, clients that take no response included")
    bad = [_report(name, [account[name] for account in accounts]) for name in (SINGLE, MANY)]
    grown = growth(seen, min(WARM_UP, seconds / 3.0))
    print(f"server, after warm-up: {grown}")
    return 1 if any(bad) or _grew(grown) else 0


def _grew(grown: Growth) -> bool:
    return grown.memory > MOST_GROWTH or grown.descriptors > 0 or grown.threads > 0


def _served(stack: ExitStack) -> str:
    """The numbers of requests that the server reports as served and refused."""
    stack.enter_context(graph(int(os.environ["ROS_DOMAIN_ID"])))
    status = stack.enter_context(caller()).reported("/push_predictor")
    return f"{status['requests_served']} and refused {status['requests_refused']}"


def _watched(server: int, asking: list[subprocess.Popen[bytes]], every: float) -> list[Vitals]:
    """The server's vitals until all clients have ended."""
    begun, seen = monotonic(), [vitals(server)]
    while any(process.poll() is None for process in asking):
        sleep(min(every, 1.0))
        if monotonic() - begun >= every * len(seen):
            seen.append(vitals(server))
            print(f"{monotonic() - begun:7.1f} s  {seen[-1]}  load {load()}", flush=True)
    if failed := [process.returncode for process in asking if process.returncode]:
        raise SystemExit(f"clients ended with status {failed}")
    return seen


def _report(name: str, accounts: list[dict[str, Any]]) -> int:
    """Print the fate of the requests of a service; returns the number of failures of the server."""
    seconds = np.concatenate([account["seconds"] for account in accounts])
    total = {key: sum(account[key] for account in accounts) for key in ("asked", "refused", "timed_out", "wrong")}
    lost = total["asked"] - len(seconds) - total["timed_out"]
    p50, p99, longest = np.percentile(seconds, [50, 99, 100]) * 1e3 if len(seconds) else [np.nan] * 3
    print(
        f"{name:20s}asked {total['asked']}, answered {len(seconds)}: p50 {p50:.2f} ms, p99 {p99:.2f} ms, longest "
        f"{longest:.1f} ms; refused {total['refused']}, answered wrongly {total['wrong']}, "
        f"no response within {TIMEOUT:g} s {total['timed_out']}, lost without an error {lost}"
    )
    return int(lost + total["refused"] + total["wrong"])


@contextmanager
def _clients(out: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a process of clients; leaving kills it, because a stopped process handles no other signal."""
    environment = {k: v for k, v in os.environ.items() if k != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    if "--clients" not in arguments:  # a stopped process would keep a lock of the shared memory of all domains
        environment["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
    command = [sys.executable, "-m", "benchmarks.nodes.load_client", "--out", str(out), *arguments]
    running = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE)
    try:
        yield running
    finally:
        running.kill()
        running.wait()


def _options() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--clients", type=int, default=50, help="default %(default)s")
    parser.add_argument("--minutes", type=float, default=10.0, help="default %(default)s")
    parser.add_argument("--rate", type=float, default=5.0, help="requests a second of each client (%(default)s)")
    parser.add_argument("--every", type=float, default=30.0, help="s between two looks at the server (%(default)s)")
    parser.add_argument("--domain", type=int, default=79, help="ROS domain to run in (default %(default)s)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
