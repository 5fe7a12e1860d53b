# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Progress: one line that changes in a terminal, lines otherwise, nothing of short work."""

from __future__ import annotations

import io
import os
import pty
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from repository import REPOSITORY

from push_predictor.cli import main
from push_predictor.commands.common import progress as module
from push_predictor.commands.common.progress import Course, progress
from push_predictor.errors import RequestError
from push_predictor.watch import Watch, part_of, watched

WORK = """
import sys, time
from push_predictor.commands.common import progress as module
module.PATIENCE = 0.02
with module.progress("train gp") as watch:
    watch("train gp: dx", 0.25)
    time.sleep(0.5)
    print("the result")
"""


# --- what is shown ----------------------------------------------------------------------------------------------------


def test_the_text_has_elapsed_time_percent_time_left_and_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: clock[0])
    course = Course("train gp")
    assert course.text(103.0) == "3 s"
    course.watch("train gp: mechanics as mean", 0.0)
    assert course.text(103.0) == "3 s, 0 %, mechanics as mean"
    course.watch("train gp: first file", 0.01)
    assert course.text(110.0) == "10 s, 1 %, first file"  # no time left of a start
    clock[0] = 110.0
    course.watch("train gp: dx", 0.25)
    assert course.text(112.0) == "12 s, 25 %, about 28 s left, dx"
    clock[0] = 120.0
    course.watch("the same again", 0.2)  # never back, and the estimate remains that of the earlier fraction
    assert course.text(120.0) == "20 s, 25 %, about 20 s left, the same again"
    assert course.text(145.0) == "45 s, 25 %, the same again"  # the estimate was too short
    course.watch("end", 1.5)
    assert course.text(125.0) == "25 s, 100 %, end"


def test_items_in_turn_report_their_share_of_a_part_of_the_work() -> None:
    seen: list[tuple[str, float]] = []
    watch = part_of(lambda stage, fraction: seen.append((stage, fraction)), 0.5, 0.9)
    assert list(watched("ab", watch, "file")) == ["a", "b"]
    assert [stage for stage, _ in seen] == ["file 1 of 2", "file 2 of 2", "file"]
    assert [fraction for _, fraction in seen] == pytest.approx([0.5, 0.7, 0.9])


# --- what reports ----------------------------------------------------------------------------------------------------


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, float]]:
    """What the commands report: task, stage, fraction."""
    found: list[tuple[str, str, float]] = []

    def watch(course: Course, stage: str, fraction: float) -> None:
        found.append((course.task, stage, fraction))

    monkeypatch.setattr(Course, "watch", watch)
    return found


def fractions(seen: list[tuple[str, str, float]], task: str) -> list[float]:
    found = [fraction for name, _, fraction in seen if name == task]
    assert found == sorted(found) and found[0] >= 0.0 and found[-1] <= 1.0
    return found


def test_commands_report_what_is_done(
    tmp_path: Path, seen: list[tuple[str, str, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("push_predictor.design.batch.CANDIDATES", 16)
    bag, model = str(tmp_path / "bag"), str(tmp_path / "m.pushmodel")
    shape = ["--shape", "rect1", "--surface", "abs", "--speed", "0.02", "--travel", "0.016"]
    assert main(["simulate", *shape, "--pushes", "10", "--out", bag]) == 0
    assert main(["train", bag, "--kind", "gp", "--mean", "zero", "--out", model]) == 0
    assert main(["suggest", model, "--count", "3", "--out", str(tmp_path / "s.csv")]) == 0
    assert main(["validate", model, bag]) == 0
    assert fractions(seen, "simulate") == pytest.approx([0.6, 0.6])
    assert fractions(seen, "train gp")[-1] == 1.0
    assert fractions(seen, "suggest") == pytest.approx([0.0, 0.6, 0.6 + 0.4 / 3, 0.6 + 0.8 / 3, 1.0])
    assert fractions(seen, "validate") == pytest.approx([0.0, 0.2, 0.6, 1.0])


def test_a_report_and_a_trace_report_what_is_done(
    tmp_path: Path, seen: list[tuple[str, str, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def reported(*arguments: object, watch: Watch, **options: object) -> tuple[Path, list[object]]:
        watch("figures", 0.5)
        return tmp_path, []

    def traced(*arguments: object, watch: Watch, **options: object) -> None:
        watch("motion", 0.15)
        raise RequestError("covariates", "x", "y")  # the rest is tested elsewhere

    monkeypatch.setattr("push_predictor.evaluation.offline.report_recording", reported)
    monkeypatch.setattr("push_predictor.residuals.trace.trace_data", traced)
    monkeypatch.setattr("push_predictor.models.store.model_file.load_model", lambda path: None)
    (tmp_path / "new.csv").touch()
    page = ["report", "validation", "m", "--recording", "bag", "--out", str(tmp_path / "r")]
    assert main(page) == 0
    assert main(["trace", "m", str(tmp_path / "new.csv")]) == 1
    assert [(task, fraction) for task, _, fraction in seen] == [("report", 0.5), ("trace", 0.15)]


# --- where it is shown ------------------------------------------------------------------------------------------------


def test_lines_are_printed_while_the_work_lasts(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = io.StringIO()
    monkeypatch.setattr(module, "PATIENCE", 0.01)
    monkeypatch.setattr(sys, "stderr", lines)
    with progress("read") as watch:
        while "read: 0 s\n" not in lines.getvalue():
            time.sleep(0.01)
        watch("second half", 0.5)
        while "50 %" not in lines.getvalue():
            time.sleep(0.01)
    printed = lines.getvalue()
    assert re.fullmatch(r"(read: 0 s(, 50 %(, about \d+ s left)?, second half)?\n)+", printed)
    time.sleep(0.05)
    assert lines.getvalue() == printed


def test_short_work_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("read") as watch:
        watch("all", 0.9)
    assert capsys.readouterr().err == ""


def test_a_terminal_shows_one_line_that_changes_and_leaves_stdout_alone(tmp_path: Path) -> None:
    master, terminal = pty.openpty()
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "TERM": "xterm", "COLUMNS": "16"}
    with (tmp_path / "out").open("w") as out:
        process = subprocess.Popen([sys.executable, "-c", WORK], stdout=out, stderr=terminal, env=environment)
        os.close(terminal)
        shown = b""
        try:
            while part := os.read(master, 4096):
                shown += part
        except OSError:  # the other end was closed
            pass
        assert process.wait() == 0, shown.decode()
    os.close(master)
    assert (tmp_path / "out").read_text() == "the result\n"
    lines = shown.decode().split("\r\x1b[K")
    assert lines[0] == lines[-1] == "" and len(lines) > 3  # the last message was removed
    assert set(lines[1:-1]) <= {"train gp: 0 s, ", "train gp: 1 s, "}  # one line of the terminal
