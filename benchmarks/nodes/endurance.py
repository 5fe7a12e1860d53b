# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A day of recorded pushes through the whole chain, accelerated: does any node grow?

    python -m benchmarks.nodes.endurance [--minutes 10] [--hours 24] [--rate 100] [--recording BAG] [--model FILE]

push_replay plays a recording in a loop, at rate 100 or as fast as the machine can, to push_validator, which requests
predictions from predict_server. The run ends after `minutes`, or once `hours` of recorded time are covered. It prints
memory, threads and file descriptors of each process, and their growth after the warm-up. The exit status is 1 if
threads grew, descriptors by more than two, or memory by more than 5 MB.

Growth by design: the validator keeps some twenty bytes of memory a window, ten megabytes a day of continuous pushing.
Windows and predictions lie in temporary files, half a kilobyte a window. A window that waits for its prediction takes
1.1 kB, for as long as the server is unreachable.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from time import monotonic
from typing import Any

from benchmarks.nodes.server_under_test import Caller, caller, graph, load, process
from benchmarks.nodes.vitals import Vitals, growth, vitals
from benchmarks.support.scripts import parser_of
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.resources import DEFAULT_MODEL, share_path

ROOT = Path(__file__).resolve().parents[2]
RECORDING = ROOT / "bags" / "square_abs_test"
# The children that live as long as their node, in the order of their start. Those after them are checks of the samples,
# which come and go.
LASTING = {"push_validator": ("resource tracker", "alarm"), "push_replay": ("resource tracker",)}
CHECK = "check"
CHECK_DESCRIPTORS = 2  # that a node has open while a check runs


def main() -> int:
    """Run the nodes, print the result; the exit status is 1 if a node grew."""
    options = _options()
    stamps = [message.log_time for message in open_bag(options.recording).messages()]
    hours, count = (max(stamps) - min(stamps)) / 3.6e12, len(stamps)
    model, before = options.model, load()
    with ExitStack() as stack:
        output = stack.enter_context(tempfile.TemporaryDirectory(prefix="push_endurance_"))
        stack.enter_context(graph(options.domain))
        client = stack.enter_context(caller())
        validating = {"model": model, "output": output, "report": False}
        playing = {
            "recording": options.recording,
            "play.rate": options.rate,
            "play.loop": True,
            "wait_for_subscribers": 20.0,
        }
        nodes = {
            "predict_server": stack.enter_context(_node("predict_server", {"models": [str(model)]})),
            "push_validator": stack.enter_context(_node("push_validator", validating)),
            "push_replay": stack.enter_context(_node("push_replay", playing)),
        }
        seen = _watched(client, nodes, options, hours / count)
        print(f"load average {before} before, {load()} after, two cores")
        grew = _grew(seen, options.warm_up * 60.0, options.most_growth)
        print(f"push_validator wrote its result within {_ended(nodes['push_validator']):.0f} s of SIGTERM")
    return 1 if grew else 0


def _watched(
    client: Caller, nodes: Mapping[str, int], options: argparse.Namespace, hours_a_message: float
) -> dict[str, list[Vitals]]:
    """Vitals of each process over time, from the first window on; before it a node may still be starting.

    hours_a_message: recorded time per message.
    """
    client.spin_until(lambda: _windows(client.diagnostics) > 0)
    earlier = int(_of(client.diagnostics, "push_replay").get("published", 0))
    begun, covered, looks = monotonic(), 0.0, 0
    seen: dict[str, list[Vitals]] = {}
    while monotonic() - begun < options.minutes * 60.0 and covered < options.hours:
        looks += 1
        client.spin_until(_clock_at(begun + looks * options.every), options.every + 10.0)
        diagnostics = client.diagnostics
        covered = (int(_of(diagnostics, "push_replay").get("published", earlier)) - earlier) * hours_a_message
        print(
            f"{monotonic() - begun:6.0f} s, {covered:6.2f} h recorded; {_figures(diagnostics)}; load {load()}",
            flush=True,
        )
        for name, number in _with_children(nodes).items():
            with suppress(*([FileNotFoundError, ProcessLookupError] if name.endswith(CHECK) else [])):  # it may end
                seen.setdefault(name, []).append(vitals(number))
                print(f"    {name:35s}{seen[name][-1]}", flush=True)
    took = monotonic() - begun
    print(f"{covered:.2f} recorded hours in {took:.0f} s: rate {covered * 3600.0 / took:.0f}")
    return seen


def _clock_at(time: float) -> Callable[[], bool]:
    return lambda: monotonic() > time


def _ended(child: int) -> float:
    """Seconds that a child takes to end; writing a day's windows takes minutes."""
    begun = monotonic()
    os.kill(child, signal.SIGTERM)
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
    return monotonic() - begun


def _figures(diagnostics: Mapping[str, Mapping[str, str]]) -> str:
    replay, validator = _of(diagnostics, "push_replay"), _of(diagnostics, "push_validator")
    lost = {key: value for key, value in validator.items() if key.endswith(" lost")}
    return (
        f"behind by {replay.get('behind_s', '?')} s, {_windows(diagnostics)} windows, validator lost {json.dumps(lost)}"
    )


def _windows(diagnostics: Mapping[str, Mapping[str, str]]) -> int:
    validator = _of(diagnostics, "push_validator")
    return next((int(value) for key, value in validator.items() if key.endswith(" windows") and key[0] != "k"), 0)


def _of(diagnostics: Mapping[str, Mapping[str, str]], node: str) -> Mapping[str, str]:
    """The latest values of a node, from the status `/NODE: SUBJECT`."""
    return next((values for name, values in diagnostics.items() if name.startswith(f"/{node}: ")), {})


def _with_children(nodes: Mapping[str, int]) -> dict[str, int]:
    """The nodes and their child processes, by name."""
    found = dict(nodes)
    for name, number in nodes.items():
        works = (*LASTING.get(name, ()), CHECK)
        found |= {f"{name}, {work}": child for work, child in zip(works, _children(number), strict=False)}
    return found


def _children(number: int) -> list[int]:
    """Child processes in the order of their start; a child belongs to the thread that started it."""
    threads = Path(f"/proc/{number}/task").iterdir()
    return sorted(int(child) for thread in threads for child in (thread / "children").read_text().split())


def _grew(seen: Mapping[str, list[Vitals]], warm_up: float, most: float) -> bool:
    grown = {name: growth(values, warm_up) for name, values in seen.items() if not name.endswith(CHECK)}
    for name, each in grown.items():
        print(f"{name:35s}after warm-up: {each}")
    return any(g.memory > most or g.threads > 0 or g.descriptors > CHECK_DESCRIPTORS for g in grown.values())


def _node(executable: str, parameters: Mapping[str, Any]) -> Any:
    assigned = [part for name, value in parameters.items() for part in ("-p", f"{name}:={_text(value)}")]
    return process("-m", f"push_predictor.nodes.{executable}", "--ros-args", *assigned)


def _text(value: Any) -> str:
    return json.dumps(str(value) if isinstance(value, Path) else value)


def _options() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="at most (default %(default)s)")
    parser.add_argument("--hours", type=float, default=24.0, help="of recorded time (default %(default)s)")
    parser.add_argument("--rate", type=float, default=100.0, help="of the replay (default %(default)s)")
    parser.add_argument("--recording", type=Path, default=RECORDING, help="default bags/square_abs_test")
    parser.add_argument("--model", type=Path, default=share_path(*DEFAULT_MODEL), help="default the shipped one")
    parser.add_argument("--every", type=float, default=30.0, help="s between two looks (default %(default)s)")
    parser.add_argument("--warm-up", type=float, default=2.0, help="minutes (default %(default)s)")
    parser.add_argument("--most-growth", type=float, default=5.0, help="MB of a process (default %(default)s)")
    parser.add_argument("--domain", type=int, default=80, help="ROS domain to run in (default %(default)s)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
