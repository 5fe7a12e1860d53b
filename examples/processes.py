# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes as separate processes, as a launch file starts them."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

LOGS = Path(__file__).resolve().parents[1] / "out" / "demo"
GRACE = 15.0  # s, from SIGINT to SIGKILL


@contextmanager
def node(
    executable: str, parameters: Mapping[str, Any], log_name: str = "", logs: Path | None = None
) -> Iterator[None]:
    """Run one of this package's nodes; leaving the context interrupts it as Ctrl-C does.

    Its output goes to EXECUTABLE.log, or LOG_NAME.log, in the folder `logs`, by default out/demo. Raises SystemExit if
    its exit status is not 0.
    """
    assigned = [part for name, value in parameters.items() for part in ("-p", f"{name}:={_text(value)}")]
    command = [sys.executable, "-m", f"push_predictor.nodes.{executable}", "--ros-args", *assigned]
    log = (logs or LOGS) / f"{log_name or executable}.log"
    with log.open("w") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=subprocess.STDOUT)
    try:
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            status = process.wait(GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            status = process.wait()
    if status != 0:
        raise SystemExit(f"{executable} ended with status {status}: see {log}")


def _text(value: Any) -> str:
    """The value of a parameter as YAML on one line."""
    return str(yaml.safe_dump(value, default_flow_style=True, width=10_000).removesuffix("\n...\n").strip())
