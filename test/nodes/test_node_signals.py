# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A node ends soon after a signal at any moment of its life, with status 0 and without a traceback."""

from __future__ import annotations

import os
import random
import resource
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest
import ros_harness as harness
from repository import REPOSITORY

pytestmark = [pytest.mark.ros, pytest.mark.slow]
NODES = {
    "predict_server": [],
    "push_recorder": ["-p", "bag:=OUT"],
    "push_replay": ["-p", f"recording:={REPOSITORY / 'bags' / 'hexagon_delrin'}"],
    "push_validator": [],
}
START = 0.6  # s of processor time, about that of a start
PATIENCE = 60.0  # s


def begun(command: Sequence[str], folder: Path) -> subprocess.Popen[bytes]:
    """A process in a group of its own, to be interrupted as Ctrl-C does."""
    environment = {
        **harness.node_environment(harness.free_domain()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
        "PUSH_PREDICTOR_CACHE": str(folder / "tables"),
    }
    return subprocess.Popen(
        [sys.executable, *command],
        cwd=REPOSITORY,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def handles_signals(process: subprocess.Popen[bytes]) -> bool:
    """Whether SIGTERM is handled, which Python by itself does not."""
    lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    caught = next(int(line.split()[1], 16) for line in lines if line.startswith("SigCgt"))
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def processor_time(process: subprocess.Popen[bytes], pattern: str = "[0-9]*") -> float:
    """That of a process and its running children (s), of those whose numbers fit the pattern."""
    ticks = 0
    for path in Path("/proc").glob(f"{pattern}/stat"):
        with suppress(OSError):  # it has just ended
            fields = path.read_text().rpartition(")")[2].split()
            ticks += sum(map(int, fields[11:13])) if int(fields[2]) == process.pid else 0
    return ticks / os.sysconf("SC_CLK_TCK")


def own_time(process: subprocess.Popen[bytes]) -> float:
    """Without its children: to look at all processes takes long."""
    return processor_time(process, str(process.pid))


def time_of_ended_processes() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def interrupted(process: subprocess.Popen[bytes], number: int = signal.SIGINT) -> tuple[str, int, float]:
    """What a process and its children print after a signal to all, its status and its processor time from then on."""
    before = time_of_ended_processes() + processor_time(process)
    os.killpg(process.pid, number)
    try:
        output, _ = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        raise AssertionError(f"signal {number} did not end it: {process.communicate()[0].decode()}") from None
    return output.decode(), process.returncode, time_of_ended_processes() - before


@pytest.mark.parametrize("node", NODES)
def test_a_node_that_starts_ends_at_once(node: str, tmp_path: Path) -> None:
    share = list(NODES).index(node)
    arguments = [word.replace("OUT", str(tmp_path / "bag")) for word in NODES[node]]
    process = begun(["-m", f"push_predictor.nodes.{node}", "--ros-args", *arguments], tmp_path)
    assert harness.wait_until(lambda: handles_signals(process))
    # All nodes together get a signal in every quarter of a start.
    work = own_time(process) + (share + random.random()) / len(NODES) * START
    harness.wait_until(lambda: own_time(process) >= work, 2.0)
    output, status, worked = interrupted(process, (signal.SIGINT, signal.SIGTERM)[share % 2])
    assert status == 0 and "Traceback" not in output and "Interrupt" not in output, output
    assert worked < 1.0, "it went on with its work"


@pytest.mark.parametrize("moment", ["constructor", "start", "blocked", "callback"])
def test_a_node_that_works_ends_at_once(moment: str, tmp_path: Path) -> None:
    process = begun(["test/support/busy_node.py", moment, "--ros-args"], tmp_path)
    assert process.stdout is not None
    while b"working" not in (line := process.stdout.readline()):
        assert line, process.wait()
    segments = shared_memory(process)
    output, status, _ = interrupted(process)
    # What it had to write at its end is written, unless it had not started.
    assert status == 0 and output.strip() == ("closed" if moment == "callback" else "")
    if moment in ("start", "callback"):
        assert segments and not [path for path in segments if path.exists()]
    for path in segments:
        path.unlink(missing_ok=True)


def shared_memory(process: subprocess.Popen[bytes]) -> list[Path]:
    """The segments of its middleware that belong to it alone."""
    maps = Path(f"/proc/{process.pid}/maps").read_text().splitlines()
    names = {line.split()[-1] for line in maps if "/dev/shm/fastrtps_" in line}
    return [Path(name) for name in names if "port" not in name]


def test_a_second_signal_ends_a_node_that_is_ending(tmp_path: Path) -> None:
    code = (
        "import sys, time; sys.path.insert(0, 'test/support'); import busy_node\n"
        "from push_predictor.nodes.runtime import run\n"
        "busy_node.BusyNode.close = lambda self: (print('closing', flush=True), time.sleep(1000.0))\n"
        "run('busy', lambda stop: busy_node.BusyNode('none'), [])\n"
    )
    process = begun(["-c", code], tmp_path)
    assert process.stdout is not None and process.stdout.readline() == b"started\n"
    segments = shared_memory(process)
    os.killpg(process.pid, signal.SIGINT)
    assert process.stdout.readline() == b"closing\n"
    assert interrupted(process)[1] == -signal.SIGINT
    for path in segments:
        path.unlink(missing_ok=True)
