# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The end of a node process: a request is obeyed wherever the main thread happens to be."""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from typing import Any

import pytest

from push_predictor import __version__
from push_predictor.errors import PushPredictorError
from push_predictor.nodes.runtime import Stop, run


def test_the_first_error_is_kept_and_requests_the_end() -> None:
    stop = Stop()
    first = RuntimeError("first")
    stop.fail(first)
    stop.fail(RuntimeError("second"))
    assert stop.requested and stop.error is first


def no_node(stop: Stop) -> Any:
    pytest.fail("a node was created")


@pytest.mark.parametrize(
    ("arguments", "status", "stream", "words"),
    [
        (["--help"], 0, "out", "docs/reference/push_replay.md"),
        (["--version"], 0, "out", f"push_predictor {__version__}"),
        (["--help", "--ros-args", "-p", "rate:=2.0"], 0, "out", "usage: push_replay"),
        (["recordng:=bags/square_abs_test"], 2, "err", "unrecognized arguments: recordng:=bags/square_abs_test"),
        (["--ros-args", "-r", "__ns:=/cell", "--", "--typo"], 2, "err", "unrecognized arguments: --typo"),
        (["--versio"], 2, "err", "unrecognized arguments: --versio"),
        (["--rate", "3", "--ros-args", "-r", "__ns:=/cell"], 2, "err", "unrecognized arguments: --rate 3"),
    ],
)
def test_help_version_and_unknown_arguments_start_no_node(
    arguments: list[str], status: int, stream: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        run("push_replay", no_node, arguments)
    assert end.value.code == status and words in getattr(capsys.readouterr(), stream)


@pytest.mark.parametrize("node", ["predict_server", "push_recorder", "push_replay", "push_validator"])
@pytest.mark.parametrize(("argument", "status"), [("--version", 0), ("--help", 0), ("--typo", 2)])
def test_every_node_answers_before_ros_starts(
    node: str, argument: str, status: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rclpy.init", lambda **_: pytest.fail("rclpy was started"))
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", "")  # push_replay sets it, for the tests after this one too
    monkeypatch.setattr(sys, "argv", [node, argument])
    gc.collect()  # a task of an earlier test's executor may print as it is collected
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        import_module(f"push_predictor.nodes.{node}").main()
    printed = capsys.readouterr()
    assert end.value.code == status and (printed.err == "") is (status == 0)
    assert node in printed.out or f"push_predictor {__version__}\n" == printed.out or status == 2


@pytest.mark.parametrize("arguments", [[], ["--ros-args", "-p", "rate:=2.0"], ["--ros-args", "-r", "__ns:=/a", "--"]])
def test_arguments_of_ros_are_left_to_it(arguments: list[str]) -> None:
    made = []

    def make_node(stop: Stop) -> Any:
        made.append(True)
        raise PushPredictorError("enough")

    assert run("push_replay", make_node, arguments) == 1 and made == [True]


def test_arguments_that_ros_refuses_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("push_replay", no_node, ["--ros-args", "-r", "nonsense"]) == 1
    assert capsys.readouterr().err.startswith("push_replay: ")


def test_an_error_of_the_program_keeps_its_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    def make_node(stop: Stop) -> Any:
        raise RuntimeError("dictionary changed size during iteration")

    with pytest.raises(RuntimeError, match="changed size"):
        run("push_replay", make_node, [])
    assert capsys.readouterr().err == ""
