# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The alarm through real nodes: a replay with a change, a replay without, and the files they leave."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from coarse import coarse_simulator
from diagnostic_msgs.msg import DiagnosticStatus
from hosted_nodes import hosted_node, refused_start
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_harness import acquaint, reserved_domain, ros_context, wait_until
from synthetic import square_rig
from validator_bench import WRITTEN, Status, beginning, hosting_replay

from push_predictor.evaluation.alarm.evidence import alarm_json
from push_predictor.evaluation.alarm.scores import Calibration, alarm_state, calibrate
from push_predictor.evaluation.offline import validate_recording
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes import push_validator
from push_predictor.online import check_process
from push_predictor.online.alarm_process import AlarmProcess
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import rig_of_table
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.changes import PLAIN, Changes, Moment
from push_predictor.simulation.rig_simulator import Sensors, SimulationSpec, random_pushes, simulate
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushAlarm

pytestmark = pytest.mark.slow

CLEAN, TRAINING, CHANGED = 4, 30, 14  # pushes
CHANGE_AT = 3
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def tilted(moment: Moment) -> Array:
    """The force on the slider of a table that is tilted by 6 degrees from push CHANGE_AT on."""
    return np.where(moment.conditions.values["push_index"] >= CHANGE_AT, 0.8, 0.0)[:, None] * [0.0, 1.0, 0.0]


def record(path: Path, pushes: int, seed: int, changes: Changes = PLAIN) -> Path:
    plan = random_pushes(pushes, [0.05], 0.05, np.random.default_rng([seed, 0]))
    few = Sensors(rate=40.0, wrench_rate=40.0)  # samples, which the nodes receive one by one
    spec = SimulationSpec("rect1", "abs", plan, seed=seed, name=path.name, changes=changes, sensors=few)
    with coarse_simulator(3.0):
        write_recording(path, simulate(spec))
    return path


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A model, a recording like those it was trained on, and one whose table is tilted meanwhile."""
    folder = tmp_path_factory.mktemp("alarm")
    unchanged = record(folder / "unchanged", CLEAN + TRAINING, seed=1)
    table, rig = load_data([unchanged]), load_rig_for([unchanged])
    model = train_model(
        table.take(np.isin(table.push_id, table.pushes[CLEAN:])),
        rig,
        "gp",
        name="gp",
        options=TrainingOptions(n_train=100, mean="zero"),
    )
    save_model(model, folder / "gp.pushmodel")
    windows = find_windows(read_recording(unchanged), rig)
    first = next(window.start for window in windows if window.push_id == table.pushes[CLEAN])
    seconds = 1e-9 * (first - read_recording(unchanged).slider.stamp[0]) - 0.5  # the tip is away
    clean = beginning(unchanged, seconds, folder / "clean")
    changed = record(folder / "changed", CHANGED, seed=2, changes=Changes(pull=tilted))
    return {"model": folder / "gp.pushmodel", "clean": clean, "changed": changed}


@dataclass
class Outcome:
    """Result, alarms, the last diagnostics and a later subscriber's alarms of a replay; output: the files it left."""

    result: dict[str, Any]
    alarms: list[PushAlarm]
    status: tuple[bytes, str, dict[str, str]]
    late: list[PushAlarm]
    output: Path


@pytest.fixture(scope="module")
def outcomes(bench: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, Outcome]:
    """Two replays through the same nodes. The first is clean: a later subscriber also receives earlier alarms."""
    output, found = tmp_path_factory.mktemp("output"), {}
    alarms: list[PushAlarm] = []
    params: dict[str, Any] = {"model": bench["model"], "output": output, "report": False, "diagnostics_period": 0.2}
    params["last_answers"] = 120.0  # the alarm is of low priority
    with (
        patch.object(check_process, "FIRST", sys.maxsize),
        reserved_domain() as domain,
        ros_context(domain) as node,
        hosted_node("predict_server", domain=domain, params={"models": [str(bench["model"])]}),
        hosted_node("push_validator", domain=domain, params=params) as process,
    ):
        status = Status(node)
        node.create_subscription(PushAlarm, "push_alarm", alarms.append, 10)
        status.wait_for_first()
        for number, recording in enumerate(("clean", "changed"), start=1):
            with hosting_replay(domain, recording=bench[recording], rate=15.0):
                assert wait_until(lambda number=number: process.text().count(WRITTEN) >= number, 240.0), process.text()
            status.wait_for_news()
            status.wait_for("state", "waiting for samples")
            result = json.loads((output / "validation.json").read_text())
            late = _late_alarms(node, alarms, fired=result["alarm"]["fired"])
            files = Path(shutil.copytree(output, output.with_name(recording)))
            found[recording] = Outcome(result, list(alarms), status.all[-1], late, files)
        assert process.stop() == 0, process.text()
    return found


def _late_alarms(node: Node, alarms: list[PushAlarm], fired: bool) -> list[PushAlarm]:
    """What a new subscriber receives, once the earlier one has received its alarm too."""
    late: list[PushAlarm] = []
    subscription = node.create_subscription(PushAlarm, "push_alarm", late.append, LATCHED)
    acquaint(node, "push_validator")  # so that half a second without an alarm means that there is none
    wait_until(lambda: bool(alarms and late), 30.0 if fired else 0.5)
    node.destroy_subscription(subscription)
    return list(late)


@pytest.fixture(scope="module")
def changed(outcomes: dict[str, Outcome]) -> Outcome:
    return outcomes["changed"]


@pytest.fixture(scope="module")
def clean(outcomes: dict[str, Outcome]) -> Outcome:
    return outcomes["clean"]


@pytest.fixture(scope="module")
def calibration(bench: dict[str, Path]) -> Calibration:
    return calibrate(load_model(bench["model"]))


@pytest.fixture(scope="module")
def validated(bench: dict[str, Path]) -> dict[str, tuple[list[PushWindow], Comparison]]:
    """Windows and comparison of both recordings, offline."""
    model = load_model(bench["model"])
    return {recording: validate_recording(model, bench[recording]) for recording in ("clean", "changed")}


def test_a_change_during_a_replay_raises_one_alarm(changed: Outcome, validated):
    (alarm,) = changed.alarms
    windows, _ = validated["changed"]
    order = list(dict.fromkeys(window.push_id for window in windows))
    assert order.index(alarm.push_id) >= CHANGE_AT - 1 and alarm.pushes == order.index(alarm.push_id) + 1
    assert alarm.log10_evidence >= 2.0 and alarm.false_alarm_rate == 0.01
    assert alarm.score == changed.result["alarm"]["score"] and alarm.model == changed.result["model"]
    stamp = alarm.header.stamp.sec * 10**9 + alarm.header.stamp.nanosec
    assert stamp == max(window.end for window in windows if window.push_id == alarm.push_id)
    assert [late.push_id for late in changed.late] == [alarm.push_id], "a later subscriber receives it too"


def test_the_diagnostics_warn_with_push_and_evidence(changed: Outcome):
    (alarm,) = changed.alarms
    level, message, values = changed.status
    assert level == DiagnosticStatus.WARN
    assert "no longer fits" in message and alarm.push_id in message
    assert values["alarm"] == "fired" and values["alarm push"] == alarm.push_id
    assert float(values["alarm fired log10 evidence"]) == pytest.approx(alarm.log10_evidence, rel=1e-5)


@pytest.mark.parametrize("recording", ["changed", "clean"])
def test_the_alarm_in_the_result_equals_the_offline_alarm(recording: str, outcomes, validated, calibration):
    windows, comparison = validated[recording]
    table, found = windows_to_table(windows), dict(outcomes[recording].result["alarm"])
    expected = alarm_json(alarm_state(calibration, table, comparison.mean, comparison.covariance))
    assert found.pop("log10_evidence") == pytest.approx(expected.pop("log10_evidence"), abs=1e-6)
    assert found == expected


def test_a_recording_without_a_change_raises_no_alarm(clean: Outcome):
    assert clean.alarms == clean.late == []
    assert clean.result["alarm"]["fired"] is False and clean.result["alarm"]["pushes"] == CLEAN
    assert clean.status[2]["alarm"] == "quiet"


def test_the_windows_are_saved_with_covariates_and_rig(changed: Outcome, validated):
    table = load_data([changed.output / "pushes.csv"])
    windows, _ = validated["changed"]
    expected = windows_to_table(windows)
    assert table.push_id.tolist() == expected.push_id.tolist()
    assert np.array_equal(table.inputs, expected.inputs) and np.array_equal(table.outcomes, expected.outcomes)
    for name in ("slider_heading", "slid_distance", "dwell_time", "normal_force"):
        assert np.array_equal(table.covariates[name], expected.covariates[name])
    assert rig_of_table(changed.output / "pushes.csv") is not None


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_rejects_a_false_alarm_rate_outside_0_to_1_by_name(
    rate: float, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    line = refused_start(push_validator.main, monkeypatch, capfd, false_alarm_rate=rate)
    assert "false_alarm_rate" in line and "above 0 and below 1" in line


# --- an alarm that cannot be -----------------------------------------------------------------------------------------


def analytical(pushes: int) -> PushModel:
    rng, rig = np.random.default_rng(0), square_rig()
    inputs = np.column_stack([np.full(40, 0.05), rng.random(40), rng.uniform(-1.0, 1.0, 40)])
    push_id = np.array([f"push-{k % pushes}" for k in range(40)])
    table = PushTable(inputs, np.full(40, 0.2), rng.standard_normal((40, 3)) * 1e-3, push_id)
    return train_model(table, rig, "analytical", name="analytical")


def test_too_few_training_pushes_turn_the_alarm_off_with_a_reason():
    alarm = AlarmProcess(0.01, lambda state, end: pytest.fail("it must not fire"))
    alarm.prepare(analytical(pushes=5))
    assert alarm.busy and wait_until(lambda: (alarm.work(), not alarm.busy)[1], 60.0)
    alarm.begin()
    alarm.work()
    assert not alarm.busy and alarm.json == {"fired": False, "off": alarm.off} and "at least 10" in alarm.off


def test_a_killed_alarm_process_does_not_end_the_node():
    alarm = AlarmProcess(0.01, lambda state, end: pytest.fail("it must not fire"))
    alarm.prepare(analytical(pushes=20))
    assert alarm._child.process is not None
    alarm._child.process.kill()
    assert wait_until(lambda: (alarm.work(), not alarm.busy)[1], 30.0)
    assert "ended" in alarm.off and alarm.json["fired"] is False
