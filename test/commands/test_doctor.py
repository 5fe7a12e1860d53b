# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`push_predictor doctor` on a complete installation and on incomplete ones."""

from __future__ import annotations

import json
import os
import runpy
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from coarse import coarse_simulator
from ros_harness import REPOSITORY, free_domain, node_environment

from push_predictor.cli import main
from push_predictor.commands import doctor_command
from push_predictor.commands.doctor import checks as doctor_checks
from push_predictor.commands.doctor.checks import (
    compiled_modules,
    executables,
    model_predicts,
    python_and_packages,
    recording_reads,
    space,
)
from push_predictor.commands.doctor.findings import Finding
from push_predictor.nodes import doctor_graph
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.write import write_recording

OF_ROS = ["rclpy", "messages", "interfaces", "middleware", "shared memory", "security", "loop-back call"]


@pytest.fixture(scope="module", autouse=True)
def coarsely() -> Iterator[None]:
    """The recording that stands for one of the user's is simulated less finely."""
    with coarse_simulator(4.0):
        yield


def with_module(folder: Path, name: str, code: str) -> str:
    """PYTHONPATH on which a module of ours is found first."""
    (folder / f"{name}.py").write_text(code)
    return os.pathsep.join([str(folder), str(REPOSITORY)])


def test_doctor_checks_every_part_of_this_installation(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    for name, value in node_environment(free_domain()).items():  # of the process that checks ROS
        monkeypatch.setenv(name, value)
    status, printed = main(["doctor", "--json", "-"]), capsys.readouterr()
    assert status == 0, printed.out + printed.err
    said = json.loads(printed.out)
    states = {check["name"]: check["state"] for check in said["checks"]}
    assert said["sound"] and "missing" not in states.values()
    assert {
        "Python",
        "numpy",
        "scipy",
        "mcap",
        "compiled",
        "executables",
        "model",
        "recording",
        "space",
        *OF_ROS,
    } <= states.keys()
    assert all(states[name] == "ok" for name in ("loop-back call", "interfaces", "model", "recording"))


def test_doctor_without_ros_names_it_and_checks_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    hidden = with_module(tmp_path, "sitecustomize", "import sys\nsys.modules.update(rclpy=None)\n")
    monkeypatch.setenv("PYTHONPATH", hidden)  # of the process that checks ROS
    assert main(["doctor"]) == 1
    printed = capsys.readouterr()
    assert printed.err.splitlines()[-1] == "push_predictor doctor: missing or broken: rclpy"
    lines = printed.out.splitlines()
    (row,) = (k for k, line in enumerate(lines) if line.startswith("missing"))
    assert lines[row].split()[1] == "rclpy"
    assert "the nodes need it" in lines[row + 1] and "pip install 'ros-jazzy-rclpy[fastrtps]'" in lines[row + 2]
    assert sum(line.startswith("ok       ") and line.split()[1] in ("model", "recording") for line in lines) == 2


@pytest.mark.parametrize(
    ("code", "words"),
    [("import time; time.sleep(60)", "no result within"), ("import os; os.abort()", "did not finish")],
)
def test_hanging_or_crashing_middleware_is_a_finding(
    code: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("PYTHONPATH", with_module(tmp_path, "rclpy", code))
    monkeypatch.setattr(doctor_command, "PATIENCE", 2.0 if "sleep" in code else 30.0)
    (finding,) = doctor_command._ros_findings()
    assert (finding.name, finding.state) == ("rclpy", "missing") and words in finding.found


def test_missing_security_is_found_before_a_node_starts():
    command = [sys.executable, "-m", "push_predictor.nodes.doctor_graph"]
    environment = {**node_environment(free_domain()), "ROS_SECURITY_ENABLE": "true"}
    done = subprocess.run(command, env=environment, cwd=REPOSITORY, capture_output=True, text=True, timeout=60.0)
    records = [json.loads(line) for line in done.stdout.splitlines()]
    last = [line for line in records if "state" in line][-1]
    assert done.returncode == 1 and (last["name"], last["state"]) == ("security", "missing")
    assert "unset ROS_SECURITY_ENABLE" in last["remedy"]


# --- each check by itself --------------------------------------------------------------------------------------------


def test_interfaces_of_another_version_are_named_by_field(monkeypatch: pytest.MonkeyPatch):
    assert doctor_graph.interfaces()["state"] == "ok"
    monkeypatch.setattr(doctor_graph, "INTERFACES", {"srv.PredictPush.Response": ("mean", "covariance", "skew")})
    found = doctor_graph.interfaces()
    assert found["state"] == "missing" and found["found"].endswith("has no srv.PredictPush.Response.skew")


def test_missing_interfaces_come_with_the_command_that_builds_them(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "push_predictor_interfaces", None)
    found = doctor_graph.interfaces()
    assert found["state"] == "missing" and "pip install ./push_predictor_interfaces" in found["remedy"]


def test_missing_message_package_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor_graph, "PACKAGES", ("geometry_msgs", "no_such_msgs"))
    found = doctor_graph.messages()
    assert (found["state"], found["found"]) == ("missing", "not found: no_such_msgs")


def test_checked_packages_equal_those_that_setup_declares():
    setup = setup_arguments()
    assert [f"{name}>={least}" for name, least in doctor_checks.NEEDED.items()] == setup["install_requires"]
    extras = {name: {row.split(">")[0] for row in rows} for name, rows in setup["extras_require"].items()}
    for name, (packages, _) in doctor_checks.EXTRAS.items():
        assert set(packages) <= extras[name], name


def test_checked_modules_equal_those_that_setup_compiles():
    compiled = [extension.name for extension in setup_arguments()["ext_modules"]]
    assert [f"push_predictor.{name}" for name in doctor_checks.COMPILED] == compiled


def setup_arguments() -> dict[str, Any]:
    """What setup.py passes to setuptools."""
    import setuptools

    given: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(REPOSITORY)
        patch.setattr(setuptools, "setup", given.update)
        runpy.run_path("setup.py")
    return given


def test_module_that_is_not_compiled_is_named_with_the_command(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor_checks, "COMPILED", ("errors", "no_such_module"))
    gone = compiled_modules()
    assert (gone.state, gone.found) == ("missing", "no_such_module: No module named 'push_predictor.no_such_module'")
    assert "`pip install -e .`" in gone.remedy and "colcon" in gone.remedy


def test_old_or_missing_package_is_named_with_the_command(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor_checks, "NEEDED", {"numpy": "99.0", "no-such-package": "1.0"})
    old, gone = (finding for finding in python_and_packages() if finding.state == "missing")
    assert (old.name, old.why, old.remedy) == ("numpy", "99.0 or newer is required", "pip install 'numpy>=99.0'")
    assert gone.name == "no-such-package" and gone.found.startswith("not found")


def test_missing_extra_is_a_note_with_its_purpose(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor_checks, "EXTRAS", {"report": (("no-such-package",), "the pictures")})
    (note,) = (finding for finding in python_and_packages() if finding.state == "note")
    assert (note.found, note.why) == ("not installed: no-such-package", "needed for the pictures")


def test_unreadable_model_is_named(tmp_path: Path):
    (tmp_path / "bad.pushmodel").write_text("no model")
    found = model_predicts(tmp_path / "bad.pushmodel")
    assert found.state == "missing" and "bad.pushmodel" in found.found


def test_given_recording_is_checked(tmp_path: Path):
    assert "10 pushes" in recording_reads(REPOSITORY / "bags" / "hexagon_delrin").found
    recording = read_recording(REPOSITORY / "bags" / "hexagon_delrin")
    write_recording(tmp_path / "without_rig", replace(recording, rig=None))
    found = recording_reads(tmp_path / "without_rig")
    assert found.state == "missing" and "no push_rig record" in found.found and found.remedy == "--rig FILE.yaml"
    assert "10 pushes" in recording_reads(tmp_path / "without_rig", rig=recording.rig).found
    (tmp_path / "bad.mcap").write_bytes(b"no recording")
    found = recording_reads(tmp_path / "bad.mcap")
    assert found.state == "missing" and "bad.mcap" in found.found


def test_proposed_path_finds_the_executables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name in doctor_checks.NODES:  # where pip installs them; colcon has another place
        (tmp_path / name).touch(mode=0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python3"))
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    note = executables()
    assert note.state == "note" and note.remedy.startswith("export PATH=")
    monkeypatch.setenv("PATH", note.remedy.removeprefix("export PATH=").removesuffix(":$PATH"))
    assert executables().state == "ok"


def test_missing_disk_space_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(tempfile, "tempdir", "/nowhere")
    assert space().state == "missing"
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(doctor_checks, "ENOUGH", 1e30)
    assert space().state == "note"


# --- what is printed -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", ["ok", "note", "missing"])
def test_only_missing_parts_are_a_failure(
    state: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    finding = Finding("thing", state, "what was found", "why it matters", "mend it")
    monkeypatch.setattr(doctor_command, "_findings", lambda model, recording, topics, rig: iter([finding]))
    assert main(["doctor", "--json", str(tmp_path / "doctor.json")]) == (state == "missing")
    printed, content = capsys.readouterr(), json.loads((tmp_path / "doctor.json").read_text())
    assert printed.out.splitlines()[1].split() == [state, "thing", "what", "was", "found"]
    assert printed.out.splitlines()[2:] == [f"{'':25s}why it matters", f"{'':25s}-> mend it"]
    assert printed.err == ("push_predictor doctor: missing or broken: thing\n" if state == "missing" else "")
    assert content["sound"] == (state != "missing") and content["checks"] == [_record(finding)]


def _record(finding: Finding) -> Mapping[str, str]:
    names = ("name", "state", "found", "why", "remedy")
    return {name: getattr(finding, name) for name in names}
