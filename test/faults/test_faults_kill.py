# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A killed server, validator, planner or replay: the others notice and continue, and files stay usable."""

from __future__ import annotations

import json
import signal
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hosted_nodes import hosted_node
from rclpy.executors import SingleThreadedExecutor
from ros_harness import NodeProcess, call, free_domain, node_process, ros_context, wait_until
from validator_bench import (
    HEXAGON,
    WRITTEN,
    Status,
    assert_same_as_offline,
    beginning,
    finish,
    hosting_replay,
    hosting_validator,
    replaying,
)

from examples.planner_client import PlannerClient
from push_predictor.cli import main as push_predictor
from push_predictor.evaluation.offline import validate_recording
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes.validator.server_client import PredictionClient
from push_predictor.online.run_files import put_aside
from push_predictor.recordings import atomic
from push_predictor.recordings.atomic import append_lines
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.table_file import read_table
from push_predictor_interfaces.msg import PushResidual
from push_predictor_interfaces.srv import PredictPush, PredictPushBatch

TIMEOUT = 0.5  # s
in_a_process = partial(node_process, "push_validator")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path, data = tmp_path_factory.mktemp("model") / "gp.pushmodel", [HEXAGON]
    save_model(
        train_model(
            load_data(data), load_rig_for(data), "gp", name="gp", options=TrainingOptions(n_train=30, mean="zero")
        ),
        path,
    )
    return path


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    found = free_domain()
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")  # a killed node would leave its shared memory behind
    monkeypatch.setenv("ROS_DOMAIN_ID", str(found))
    yield found


def server(domain: int, model: Path) -> Any:
    return node_process("predict_server", domain=domain, params={"models": [str(model)]})


def validator(domain: int, model: Path, output: Path, start: Any = hosting_validator) -> Any:
    params = {"model": model, "output": output, "report": False, "diagnostics_period": 0.2, "request_timeout": TIMEOUT}
    return start(domain=domain, params={**params, "last_answers": 120.0})


def kill(process: NodeProcess) -> None:
    process.send_signal(signal.SIGKILL)
    process.wait()


def residuals_received(node: Any) -> list[PushResidual]:
    received: list[PushResidual] = []
    node.create_subscription(PushResidual, "push_residual", received.append, 1000)
    return received


# --- predict_server --------------------------------------------------------------------------------------------------


class Planning(threading.Thread):
    """A planner that sends requests one after another, its answers and how long each took."""

    def __init__(self, inputs: np.ndarray) -> None:
        super().__init__(daemon=True)
        self._inputs, self._ending = inputs, threading.Event()
        self.answers: list[tuple[float, np.ndarray]] = []
        self.start()

    def run(self) -> None:
        with PlannerClient(0.2, timeout=TIMEOUT, patience=60.0) as client:
            while not self._ending.is_set():
                begun = time.monotonic()
                mean = client.predict(self._inputs).mean
                self.answers.append((time.monotonic() - begun, mean))
                self._ending.wait(0.2)  # a planner that asks without a pause would keep a processor busy

    def stop(self) -> None:
        self._ending.set()
        self.join(30.0)


@pytest.mark.slow
def test_validator_and_planner_survive_a_killed_server_and_report_the_gap(
    domain: int, model: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    inputs, recording = load_model(model).training.inputs[:20], beginning(HEXAGON, 5.2, tmp_path / "hexagon")
    with ros_context(domain) as node, validator(domain, model, tmp_path) as process:
        status, received = Status(node), residuals_received(node)
        status.wait_for_first()
        planner = Planning(inputs)
        with server(domain, model) as first:
            assert wait_until(lambda: len(planner.answers) >= 6, 60.0)
            status.wait_for_server()
            with hosting_replay(domain, recording=recording, rate=2.0):
                assert wait_until(lambda: len(received) >= 5, 60.0)
                kill(first)
                status.wait_for_message(silent := f"predict_push: no answer within {TIMEOUT:g} s", 30.0)
                with hosted_node("predict_server", domain=domain, params={"models": [str(model)]}):
                    assert wait_until(lambda: silent not in status.message, 60.0)
                    before = len(planner.answers)
                    assert wait_until(lambda: len(planner.answers) > before + 2)
                    planner.stop()
                    assert silent in process.wait_for_text(WRITTEN, 120.0)
    assert int(status.values["timeouts"]) > 0
    assert_same_as_offline(tmp_path, model, recording)
    text = capfd.readouterr().err
    assert "predict_push_batch: no response within 0.5 s, sending the request again" in text
    assert "predict_push_batch: responds again after" in text and "requests had no response" in text
    assert any(taken > TIMEOUT for taken, _ in planner.answers[5:])  # a request bridged the gap
    assert all(np.array_equal(mean, planner.answers[0][1]) for _, mean in planner.answers)


def test_a_planner_gives_up_after_its_patience_with_a_reason(domain: int):
    with ros_context(domain) as node, PlannerClient(0.2, timeout=0.2, patience=0.5) as client:
        with pytest.raises(
            SystemExit, match=r"predict_push_batch: no such service within 0.5 s. Is predict_server running"
        ):
            client.predict(np.array([[0.02, 0.1, 0.0]]))
        node.create_service(
            PredictPushBatch, "predict_push_batch", lambda request, response: time.sleep(1.5) or response
        )
        assert wait_until(client._batch.service_is_ready)
        client._patience = 1.0
        with pytest.raises(SystemExit, match=r"no response to \d requests within 1 s"):
            client.predict(np.array([[0.02, 0.1, 0.0]]))


def test_answers_to_other_clients_do_not_crowd_out_the_validators(domain: int):
    """The middleware delivers the answers to all clients: here 300, while the executor does not run."""
    with ros_context(domain) as node:
        node.create_service(PredictPush, "predict_push", lambda request, response: response)
        other = node.create_client(PredictPush, "predict_push")
        with ros_context(domain) as busy:
            ours = PredictionClient(busy, timeout=60.0)
            # The server must have discovered both clients, `other` and ours, before it can answer them.
            assert wait_until(lambda: ours.server_available and node.count_clients("predict_push") == 2)
            busy.executor.shutdown()  # nobody takes answers
            answers: list[PredictPush.Response] = []
            ours.ask(PredictPush.Request(), answers.append)
            ours.work()
            time.sleep(0.2)
            for _ in range(300):
                call(other, PredictPush.Request())
            executor = SingleThreadedExecutor(context=busy.context)
            executor.add_node(busy)
            assert wait_until(lambda: executor.spin_once(0.0) or bool(answers), 50.0)
            assert ours.timeouts == 0
            executor.shutdown()


# --- push_validator and push_replay ----------------------------------------------------------------------------------


@pytest.mark.long
def test_a_killed_validator_leaves_its_data_and_the_next_one_keeps_them(
    domain: int, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    windows, comparison = validate_recording(load_model(model), HEXAGON)
    expected = {(w.push_id, w.index): (w, mean) for w, mean in zip(windows, comparison.mean, strict=True)}
    with ros_context(domain) as node, server(domain, model):
        received = residuals_received(node)
        with validator(domain, model, tmp_path, in_a_process) as process:
            Status(node).wait_for_server()
            with replaying(domain, rate=2.0) as replay:
                assert wait_until(lambda: len(received) >= 20, 60.0)
                kill(process)
                published = len(received)
                replay.stop()
        left = read_table(tmp_path / "residuals.csv")
        assert not (tmp_path / "validation.json").exists()
        assert published <= len(left) <= len(read_table(tmp_path / "pushes.csv")) < len(windows)
        for row in range(len(left)):
            window, mean = expected[left.push_id[row], int(left.covariates["window"][row])]
            assert np.allclose(left.outcomes[row], window.displacement, rtol=0.0, atol=1e-12)
            predicted = [left.covariates[f"predicted_{name}"][row] for name in ("dx", "dy", "dtheta")]
            assert np.max(np.abs(np.array(predicted) - mean)) < 1e-9
        for name in ("residuals.csv", "pushes.csv"):
            assert push_predictor(["info", str(tmp_path / name)]) == 0
        assert f"rows        {len(left)}" in capsys.readouterr().out

        # The next validator finds the files; its replay, which has nothing to write, is killed.
        with validator(domain, model, tmp_path, in_a_process) as process:
            status, before = Status(node), len(received)
            status.wait_for_server()
            with replaying(domain, rate=2.0) as replay:
                assert wait_until(lambda: len(received) >= before + 20, 60.0)
                kill(replay)
            text = status.wait_for_message("No usable sample for 5 s.", 60.0)
            assert "Call `~/finish` to write the results." in text and status.values["state"] == "validating"
            assert finish(node).success
            (kept,) = tmp_path.glob("cut_off_*")
            assert f"are saved in {kept}. It has no validation.json" in process.text()
    assert {path.name for path in kept.iterdir()} == {"pushes.csv", "pushes.rig.yaml", "residuals.csv"}
    assert len(read_table(kept / "residuals.csv")) == len(left)
    assert not (tmp_path / "residuals.csv").exists()  # replaced by the bag
    assert 20 <= json.loads((tmp_path / "validation.json").read_text())["n_test"] < len(windows)


def test_a_completed_run_is_not_moved(tmp_path: Path):
    (tmp_path / "pushes.csv").write_text("complete")
    assert put_aside(tmp_path) is None and (tmp_path / "pushes.csv").exists()


def test_lines_are_appended_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The disk accepts half of the third line."""
    path, written = tmp_path / "lines", []

    def write(descriptor: int, data: bytes) -> int:
        written.append(data)
        return real(descriptor, data if len(written) < 3 else data[:4])

    real = atomic.os.write
    monkeypatch.setattr(atomic.os, "write", write)
    with pytest.raises(OSError, match=r"No space left.*lines"):
        append_lines(path, ["first line", "second line", "third line", "fourth line"])
    assert path.read_text() == "first line\nsecond line\n"
    assert len(written) == 3
