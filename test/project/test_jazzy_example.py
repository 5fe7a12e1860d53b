# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""scripts/jazzy_example.sh, which README.md names: every file, executable, argument and option in it exists."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
from fake_launch import install_fake_launch, load_launch_file
from repository import REPOSITORY

from push_predictor.cli import build_parser
from push_predictor.resources import SHIPPED

SCRIPT = REPOSITORY / "scripts" / "jazzy_example.sh"
LINES = [line for line in SCRIPT.read_text().splitlines() if line and not line.startswith("#") and line != "set -e"]
CALLS = [shlex.split(line) for line in LINES]
TOOLS = {".", "[", "colcon", "export", "ros2", "rosdep", "sudo"}
OF_UBUNTU = {"python3-pip", "python3-rosdep", "python3-colcon-common-extensions"}  # the last two from ROS's repository


def words_after(*start: str) -> list[str]:
    """The words behind the only call that starts with these."""
    (found,) = (call[len(start) :] for call in CALLS if tuple(call[: len(start)]) == start)
    return found


def test_readme_names_the_script():
    assert f"`sh {SCRIPT.relative_to(REPOSITORY)}`" in (REPOSITORY / "README.md").read_text()


def test_the_shell_parses_it_and_every_tool_is_one_that_jazzy_has():
    subprocess.run(["sh", "-n", str(SCRIPT)], check=True)
    assert {call[0] for call in CALLS} == TOOLS
    assert set(words_after("sudo", "apt", "install", "-y")) == OF_UBUNTU
    assert words_after("export") == ["PIP_BREAK_SYSTEM_PACKAGES=1"]  # pip refuses Ubuntu's Python without it
    assert words_after("colcon", "build") == ["--packages-up-to", "push_predictor"]


def test_rosdep_is_given_the_folders_of_the_packages_that_are_built():
    """It stops descending at a package, and the root is one."""
    words = words_after("rosdep", "install")
    assert set(words[: words.index("--from-paths")]) == {"-y", "--ignore-src"}
    folders = words[words.index("--from-paths") + 1 :]
    assert folders == [".", "push_predictor_interfaces"]
    assert all((REPOSITORY / folder / "package.xml").is_file() for folder in folders)


@pytest.mark.parametrize("document", ["README.md", "CONTRIBUTING.md", "docs/explanation/unproven.md"])
def test_every_documented_call_of_rosdep_names_the_nested_package(document: str):
    text = (REPOSITORY / document).read_text()
    for call in re.findall(r"rosdep install [^`\n]+", text):
        assert "push_predictor_interfaces" in call, call


def test_the_executable_and_its_command_exist():
    executable, *command = words_after("ros2", "run", "push_predictor")
    assert (REPOSITORY / "scripts" / "run" / executable).is_file()
    build_parser().parse_args(command)


def test_the_launch_file_takes_its_arguments(monkeypatch: pytest.MonkeyPatch):
    install_fake_launch(monkeypatch)
    name, *words = words_after("ros2", "launch", "push_predictor")
    launch_file: dict[str, Any] = load_launch_file(REPOSITORY / "launch" / name)
    given = dict(word.split(":=") for word in words)
    assert given.keys() <= {argument for argument, _, _ in launch_file["ARGUMENTS"]}
    recording = Path(given["recording"].replace("$PWD", str(REPOSITORY)))
    assert (recording / "metadata.yaml").is_file() and float(given["rate"]) > 0.0
    assert given["model"] == SHIPPED  # nothing is trained before


def test_every_documented_launch_names_a_file_and_its_arguments(monkeypatch: pytest.MonkeyPatch):
    install_fake_launch(monkeypatch)
    accepted = {
        path.name: {argument for argument, _, _ in load_launch_file(path)["ARGUMENTS"]}
        for path in (REPOSITORY / "launch").glob("*.launch.py")
    }
    documents = [SCRIPT, *REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")]
    text = "\n".join(path.read_text().replace("\\\n", " ") for path in documents)
    calls = re.findall(r"ros2 launch push_predictor (\w+\.launch\.py)([^`\n]*)", text)
    assert len(calls) > 8
    for name, words in calls:
        given = set(re.findall(r"(\w+):=", words)) - {"recrding"}  # the example of what is refused
        assert given <= accepted[name], words
