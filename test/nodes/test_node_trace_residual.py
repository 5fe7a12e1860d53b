# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The action trace_residual: goal, feedback and result, cancellation and failures."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import ros_harness as harness
from action_msgs.msg import GoalStatus
from hosted_nodes import hosted_node, refused_start
from lifecycle_msgs.msg import Transition
from made_up_traces import made_up_trace, pushes, slippery
from trace_bench import RIG, SLIDING, TraceServer, drifting_folder, trace_server_of

from push_predictor.errors import PushPredictorError
from push_predictor.models.store.model_file import load_model
from push_predictor.nodes import predict_server
from push_predictor.online import trace_process
from push_predictor.online.trace_process import COPIES, EXTENDED, REPORT, VERDICT, TraceTask, evidence_in
from push_predictor.recordings.table_file import read_table, write_table


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model, and a folder of pushes whose contact friction drifts."""
    return drifting_folder(tmp_path_factory.mktemp("trace"))


@pytest.fixture
def drifting(place: Path, tmp_path: Path) -> Path:
    """A copy of that folder."""
    return Path(shutil.copytree(place / "drifting", tmp_path / "result"))


@pytest.fixture(scope="module")
def server(place: Path) -> Iterator[TraceServer]:
    """One server for all tests that do not change it."""
    with trace_server_of(place / "deployed.pushmodel") as running:
        yield running


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_trace_writes_a_model_for_load_model_while_predictions_go_on(
    server: TraceServer, drifting: Path, tmp_path: Path
) -> None:
    """Of data in another place than the result, to which a validator is writing."""
    last = (drifting / "pushes.csv").read_text().splitlines()[-1]
    with (drifting / "pushes.csv").open("a") as stream:
        stream.write(last[: len(last) // 2])
    before, output = names(drifting), tmp_path / "output"
    goal, answered = server.trace(output, data=drifting), set[str]()
    while not goal.ended:
        assert server.push().success
        answered.update(stage for stage, _ in goal.stages[-1:])
        time.sleep(0.05)
    status, result = goal.end()
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True), result.message
    assert len(answered - {"done"}) > 1, answered  # those that waited for the trace would be answered at its end
    # Feedback and result can arrive in either order.
    assert harness.wait_until(lambda: goal.stages[-1:] == [("done", 1.0)]), goal.stages
    shares = [share for _, share in goal.stages]
    assert {"measurement", "motion", "report", "done"} <= dict(goal.stages).keys()
    assert shares == sorted(shares) and shares[-1] == 1.0

    verdict = json.loads(result.verdict)
    assert verdict["effects"][0]["covariate"] == "elapsed_time" and verdict["motion_model_changed"]
    assert json.loads((output / VERDICT).read_text()) == verdict and verdict["alpha"] == 0.01
    assert names(output) == sorted([EXTENDED, REPORT, VERDICT]) and names(drifting) == before
    assert result.extended_model == str(output / EXTENDED) and "its requests need no covariates" in result.message
    assert list(load_model(output / EXTENDED).defaults) == ["elapsed_time"]

    assert server.load(result.extended_model, "extended").success
    early, end, alone = (
        server.push(SLIDING, model="extended", covariates=given)
        for given in ({"elapsed_time": 0.0}, {"elapsed_time": 1000.2}, {})  # the second after the last window
    )
    assert early.success and end.success and list(alone.mean) == list(end.mean) != list(early.mean)
    assert server.push().success  # the deployed model still predicts


def test_second_goal_is_refused_and_a_cancelled_trace_leaves_no_files(
    server: TraceServer, drifting: Path, tmp_path: Path
) -> None:
    before = names(drifting)
    first = server.trace(drifting, covariates=[])
    worker = server.held()
    (work,) = drifting.glob(".trace-*")
    (work / VERDICT).touch()  # as if it had written something by then
    status, result = server.trace(tmp_path / "other").end()
    assert status == GoalStatus.STATUS_ABORTED and not result.success and result.error_code == result.BUSY
    assert "one at a time" in result.message and "deployed" in result.message
    assert not (tmp_path / "other").exists() and not first.ended

    first.handle.cancel_goal_async()
    status, result = first.end()
    assert status == GoalStatus.STATUS_CANCELED and not result.success and "cancelled" in result.message
    assert result.error_code == result.CANCELLED
    assert names(drifting) == before and worker not in server.workers()
    assert server.push().success


def test_killed_process_aborts_the_goal_and_the_server_continues(server: TraceServer, drifting: Path) -> None:
    before = names(drifting)
    goal = server.trace(drifting, covariates=[])
    os.kill(server.held(), signal.SIGKILL)
    status, result = goal.end()
    assert status == GoalStatus.STATUS_ABORTED and "signal 9" in result.message
    assert names(drifting) == before and server.push().success


def cut(folder: Path) -> None:
    text = (folder / "pushes.csv").read_text().replace("velocity", "speed", 1)
    (folder / "pushes.csv").write_text(text)


BAD = {
    "no output": ({"output": ""}, ["output: ''"]),
    "no folder": ({"output": "absent"}, ["output", "absent", "no data to trace", "pushes.csv"]),
    "no data": ({"data": "/nowhere"}, ["data /nowhere: no data to trace"]),
    "unknown model": ({"model": "other"}, ["model: 'other'", "deployed"]),
    "not a table": ({"change": cut}, ["pushes.csv line 1", "velocity"]),
}
BAD_DATA = {
    "unknown covariate": ({"covariates": ("topic:/warmth",)}, ["topic:/warmth", "elapsed_time"]),
    "no rig": ({"change": lambda folder: (folder / RIG).unlink()}, [RIG]),
    "few pushes": ({"change": lambda folder: write_table(folder / "pushes.csv", pushes(5, 3))}, ["pushes: 5", "12"]),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_goal_is_aborted_with_the_reason(case: str, server: TraceServer, drifting: Path) -> None:
    given, words = BAD[case]
    request: dict[str, Any] = {"output": drifting, **given}
    change = request.pop("change", lambda folder: None)
    if request["output"] == "absent":
        request["output"] = drifting / "absent"
    change(drifting)
    before = names(drifting)
    status, result = server.trace(**request).end()
    assert status == GoalStatus.STATUS_ABORTED and not result.success and result.verdict == ""
    assert all(word in result.message for word in words), result.message
    assert ".trace-" not in result.message and names(drifting) == before


@pytest.mark.parametrize("case", BAD_DATA)
def test_process_of_a_trace_reports_the_reason(
    case: str, place: Path, drifting: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this process, whose priority is kept."""
    given, words = BAD_DATA[case]
    given.get("change", lambda folder: None)(drifting)
    (folder := drifting / ".trace-work").mkdir()
    task = TraceTask(
        (drifting / "pushes.csv",), place / "deployed.pushmodel", given.get("covariates", ()), 0.01, folder
    )
    with pytest.raises(PushPredictorError) as failure:
        trace_process.run_trace(SimpleNamespace(send=lambda message: None), task)
    reason = trace_process.for_client(str(failure.value), task)
    assert ".trace-" not in reason and all(word in reason for word in words), reason
    assert {path.name for path in folder.iterdir()} <= {COPIES}


def test_process_of_a_trace_adds_the_warnings_of_the_checks_to_its_message(
    place: Path, drifting: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trace_process, "_report", lambda path, trace: [])
    found = made_up_trace(slippery(0.1), count=30)
    monkeypatch.setattr("push_predictor.residuals.trace.trace", lambda *_, **__: found)
    table = read_table(drifting / "pushes.csv")
    write_table(drifting / "pushes.csv", replace(table, inputs=table.inputs * [1.0, 1.0, 0.1]))
    (folder := drifting / ".trace-work").mkdir()
    sent: list[Any] = []
    task = TraceTask((drifting / "pushes.csv",), place / "deployed.pushmodel", (), 0.01, folder)
    trace_process.run_trace(SimpleNamespace(send=sent.append), task)
    assert f"Warning: {drifting}/pushes.csv: The push angles span" in sent[-1].message


def test_ending_node_aborts_the_goal_and_ends_the_process(place: Path, drifting: Path) -> None:
    before = names(drifting)
    with trace_server_of(place / "deployed.pushmodel", hosted_node, trace_alpha=0.05) as server:
        assert server.change(Transition.TRANSITION_DEACTIVATE)
        assert not server.trace(drifting).accepted
        assert server.change(Transition.TRANSITION_ACTIVATE)
        goal = server.trace(drifting, covariates=[])
        worker = server.held()
        assert server.process.stop() == 0
        assert harness.wait_until(lambda: not Path(f"/proc/{worker}").exists(), 30.0)
        status, result = goal.end()
        assert status == GoalStatus.STATUS_ABORTED and "the node ends" in result.message
    assert names(drifting) == before


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_rejects_alpha_out_of_range_at_start(
    alpha: float, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    line = refused_start(predict_server.main, monkeypatch, capfd, trace_alpha=alpha)
    assert f"trace_alpha: {alpha} is not accepted" in line


def test_evidence_in_a_folder(tmp_path: Path) -> None:
    assert evidence_in(tmp_path / "absent") == () == evidence_in(tmp_path)
    for bag in ("second", "first", "residuals"):
        (tmp_path / bag).mkdir()
        (tmp_path / bag / "metadata.yaml").touch()
    (tmp_path / "windows.json").touch()
    (tmp_path / "more.csv.gz").touch()
    assert [path.name for path in evidence_in(tmp_path)] == ["first", "more.csv.gz", "second"]
    assert evidence_in(tmp_path / "first") == (tmp_path / "first",)
    assert evidence_in(tmp_path / "more.csv.gz") == (tmp_path / "more.csv.gz",)
    (tmp_path / "pushes.csv").touch()
    assert evidence_in(tmp_path) == (tmp_path / "pushes.csv",)
