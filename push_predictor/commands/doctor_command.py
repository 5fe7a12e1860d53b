"""push_predictor doctor: is this installation sound, and if not, what mends it."""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from push_predictor import __version__
from push_predictor.commands.doctor_checks import (
    executables,
    model_predicts,
    python_and_packages,
    recording_reads,
    room,
)
from push_predictor.commands.doctor_findings import Finding
from push_predictor.commands.output import add_command, progress, write_json
from push_predictor.errors import PushPredictorError

PATIENCE = 90.0  # s for all that concerns ROS


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The sub-command `doctor`."""
    parser = add_command(
        commands,
        "doctor",
        "Is this installation sound? Checks Python, packages, ROS, interfaces, discovery and security; predict_server "
        "has to answer a call, a model to predict, a recording to be read. Says what is missing, why that matters and "
        "what mends it.",
        "push_predictor doctor --recording bags/square_abs_test",
    )
    parser.add_argument("--model", type=Path, metavar="MODEL", help="check this model file (default: the shipped one)")
    parser.add_argument(
        "--recording", type=Path, metavar="RECORDING", help="check this recording (default: one made for the purpose)"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Check everything, print. Raises PushPredictorError that names what is missing."""
    with progress("doctor"):
        findings = list(_findings(options.model, options.recording))
    missing = [finding.name for finding in findings if finding.state == "missing"]
    content = {"version": __version__, "sound": not missing, "checks": [finding.record() for finding in findings]}
    if not write_json(options, content):
        print(f"push_predictor {__version__}")
        for finding in findings:
            print("\n".join(finding.lines))
    if missing:
        raise PushPredictorError(f"missing or broken: {', '.join(missing)}")


def _findings(model: Path | None, recording: Path | None) -> Iterator[Finding]:
    yield from python_and_packages()
    yield from _of_ros()
    yield executables()
    yield model_predicts(model)
    yield recording_reads(recording)
    yield room()


def _of_ros() -> Iterator[Finding]:
    """What push_predictor.nodes.doctor_graph finds; it runs apart, since a middleware may hang or crash."""
    process = subprocess.Popen(
        [sys.executable, "-m", "push_predictor.nodes.doctor_graph"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # it starts a node, which is to end with it
    )
    ended = ""
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        ended = f"nothing came within {PATIENCE:.0f} s"
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    if ended:
        out, err = process.communicate()
    yield from _told(out, ended or (err.strip().splitlines() or ["without a word"])[-1])


def _told(out: str, ended: str) -> Iterator[Finding]:
    """The findings in the lines; a check that was begun and did not end has a finding that says how it ended."""
    begun = "rclpy"
    for line in out.splitlines():
        told = json.loads(line)
        begun = "" if "state" in told else told["name"]
        if "state" in told:
            yield Finding(**told)
    if begun:
        why, remedy = "the nodes will not run either", "python -m push_predictor.nodes.doctor_graph"
        yield Finding(begun, "missing", f"the check ended before its time: {ended}", why, remedy)
