# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`push_predictor doctor` on a complete installation and on incomplete ones."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest
from ros_harness import REPOSITORY, free_domain, node_environment

from push_predictor import blas_threads
from push_predictor.cli import main
from push_predictor.commands import doctor_command
from push_predictor.commands.doctor_command import compiled_modules, ros_node


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of the process which checks ROS."""
    for name, value in node_environment(free_domain()).items():
        monkeypatch.setenv(name, value)


def hide(folder: Path, name: str, code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module of ours is found first by the process that checks ROS."""
    (folder / f"{name}.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(REPOSITORY)]))


def test_doctor_finds_nothing_missing_in_this_installation(capsys: pytest.CaptureFixture[str]) -> None:
    status, printed = main(["doctor", "--json", "-"]), capsys.readouterr()
    assert status == 0, printed.out + printed.err
    content = json.loads(printed.out)
    states = {check["name"]: check["state"] for check in content["checks"]}
    assert content["sound"] and states == dict.fromkeys(("packages", "compiled", "prediction", "ROS"), "ok")


def test_doctor_without_ros_names_it_and_checks_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hide(tmp_path, "sitecustomize", "import sys\nsys.modules.update(rclpy=None)\n", monkeypatch)
    assert main(["doctor"]) == 1
    printed = capsys.readouterr()
    assert printed.err.splitlines()[-1] == "push_predictor doctor: missing or broken: ROS"
    lines = printed.out.splitlines()
    (row,) = (k for k, line in enumerate(lines) if line.startswith("missing"))
    assert lines[row].split()[1] == "ROS" and "rclpy" in lines[row]
    assert "pip install 'ros-jazzy-rclpy[fastrtps]' ./push_predictor_interfaces" in lines[row + 1]
    assert sum(line.startswith("ok       ") for line in lines) == 3


@pytest.mark.parametrize(
    ("module", "code", "words"),
    [
        ("rclpy", "import time; time.sleep(60)", "no result within"),
        ("rclpy", "import os; os.abort()", "ended with status -6"),
        ("sitecustomize", "import sys\nsys.modules.update(push_predictor_interfaces=None)\n", "push_predictor_interf"),
    ],
)
def test_hanging_crashing_or_missing_middleware_is_a_finding(
    module: str, code: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hide(tmp_path, module, code, monkeypatch)
    monkeypatch.setattr(doctor_command, "PATIENCE", 0.5 if "sleep" in code else 60.0)
    finding = ros_node()
    assert (finding.name, finding.state) == ("ROS", "missing") and words in finding.found and finding.remedy


def test_missing_security_is_found_before_a_node_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    finding = ros_node()
    assert finding.state == "missing" and "security is requested (ROS_SECURITY_ENABLE=true" in finding.found


def test_missing_package_and_bad_model_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.pushmodel").write_text("no model")
    monkeypatch.setattr(doctor_command, "REQUIRED", ("numpy", "no_such_package"))
    monkeypatch.setattr("push_predictor.resources.share_path", lambda *parts: tmp_path / "bad.pushmodel")
    monkeypatch.setattr(doctor_command, "ros_node", lambda: doctor_command.Finding("ROS", "ok", ""))
    assert main(["doctor", "--json", "-"]) == 1
    printed = capsys.readouterr()
    packages, _, prediction, _ = json.loads(printed.out)["checks"]
    assert "no_such_package" in packages["found"] and packages["remedy"] == "pip install ."
    assert prediction["state"] == "missing" and "bad.pushmodel" in prediction["found"]
    assert printed.err.strip().endswith("missing or broken: packages, prediction")


def test_module_that_is_not_compiled_is_named_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor_command, "COMPILED", ("errors", "no_such_module"))
    gone = compiled_modules()
    assert gone.state == "missing" and "No module named 'push_predictor.no_such_module'" in gone.found
    assert "`pip install -e .`" in gone.remedy and "colcon" in gone.remedy


def test_without_threadpoolctl_all_else_works_and_is_noted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "threadpoolctl", None)
    monkeypatch.setitem(blas_threads._process, "limited", False)
    blas_threads._libraries.cache_clear()
    try:
        assert main(["doctor"]) == 0
    finally:
        blas_threads._libraries.cache_clear()
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "packages" in line)
    assert (
        line.startswith("ok")
        and "yaml" in line
        and line.endswith(
            "; without threadpoolctl a program that imports numpy first uses many threads for small matrices, slowly"
        )
    )
