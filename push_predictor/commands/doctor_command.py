# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor doctor: check the installation and report how to fix it."""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor import __version__
from push_predictor.commands.common.options import (
    add_command,
    add_model,
    add_recording,
    add_rig,
    add_topics,
    save_topics_of,
    topics_of,
)
from push_predictor.commands.common.output import write_json
from push_predictor.commands.common.progress import progress
from push_predictor.commands.doctor.checks import (
    compiled_modules,
    executables,
    model_predicts,
    python_and_packages,
    recording_reads,
    space,
)
from push_predictor.commands.doctor.findings import Finding
from push_predictor.errors import PushPredictorError

if TYPE_CHECKING:
    from push_predictor.recordings.rig import Rig
    from push_predictor.recordings.topics import Topics

PATIENCE = 90.0  # s for all checks of ROS


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command `doctor`."""
    parser = add_command(
        commands,
        "doctor",
        "Check this installation. Tests Python, packages, ROS, interfaces, discovery and security. Calls "
        "predict_server, predicts with a model and reads a recording. Reports what is missing, why it matters and "
        "how to fix it.",
        "push_predictor doctor --recording bags/square_abs_test",
    )
    add_model(parser, "?", note=" to predict with (default: the shipped one)")
    add_recording(parser, "default: a simulated one")
    add_rig(parser)
    add_topics(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Run all checks and print the findings. Raises PushPredictorError that names what is missing."""
    from push_predictor.recordings.rig import load_rig

    with progress("doctor"):
        rig = load_rig(options.rig) if options.rig else None
        findings = list(_findings(options.model, options.recording, topics_of(options), rig))
        save_topics_of(options, [options.recording] if options.recording else [])
    missing = [finding.name for finding in findings if finding.state == "missing"]
    content = {"version": __version__, "sound": not missing, "checks": [finding.record() for finding in findings]}
    if not write_json(options, content):
        print(f"push_predictor {__version__}")
        for finding in findings:
            print("\n".join(finding.lines))
    if missing:
        raise PushPredictorError(f"missing or broken: {', '.join(missing)}")


def _findings(model: Path | None, recording: Path | None, topics: Topics, rig: Rig | None) -> Iterator[Finding]:
    yield from python_and_packages()
    yield compiled_modules()
    yield from _ros_findings()
    yield executables()
    yield model_predicts(model)
    yield recording_reads(recording, topics, rig)
    yield space()


def _ros_findings() -> Iterator[Finding]:
    """Findings of push_predictor.nodes.doctor_graph, in its own process because a middleware may hang or crash."""
    process = subprocess.Popen(
        [sys.executable, "-m", "push_predictor.nodes.doctor_graph"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # it starts a node, which must end with it
    )
    ended = ""
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        ended = f"no result within {PATIENCE:.0f} s"
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    if ended:
        out, err = process.communicate()
    yield from _parsed(out, ended or (err.strip().splitlines() or ["no message"])[-1])


def _parsed(out: str, ended: str) -> Iterator[Finding]:
    """Findings in the output lines. A check that began and did not finish gives a finding that states how it ended."""
    begun = "rclpy"
    for line in out.splitlines():
        record = json.loads(line)
        begun = "" if "state" in record else record["name"]
        if "state" in record:
            yield Finding(**record)
    if begun:
        why, remedy = "the nodes will fail in the same way", "python -m push_predictor.nodes.doctor_graph"
        yield Finding(begun, "missing", f"the check did not finish: {ended}", why, remedy)
