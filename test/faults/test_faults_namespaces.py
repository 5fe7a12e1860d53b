# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Two robots in one domain: server, validator and replay in two namespaces stay independent."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from ros_harness import START_TIMEOUT, acquaint, call, free_domain, node_process, ros_context, wait_until
from validator_bench import CIRCLE, HEXAGON, WRITTEN, assert_same_as_offline, replaying

from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes.qos import LATCHED
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor_interfaces.msg import PushResidual, PushRig
from push_predictor_interfaces.srv import ListModels, PredictPush, Resume

pytestmark = pytest.mark.long

CELLS = {"/cell1": HEXAGON, "/cell2": CIRCLE}


@dataclass
class Received:
    """The messages published in one namespace."""

    residuals: list[PushResidual] = field(default_factory=list)
    sliders: list[bytes] = field(default_factory=list)
    rigs: list[PushRig] = field(default_factory=list)


@dataclass
class Both:
    """Two cells that ran at the same time: their files, messages, diagnostics by name, answers."""

    models: dict[str, Path]
    outputs: dict[str, Path]
    received: dict[str, Received]
    diagnostics: dict[str, dict[str, str]]
    answers: dict[str, list[PredictPush.Response]]
    listed: dict[str, list[str]]


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Both:
    """Both cells request a model by the same name, which is a different model in each; both replays run at once."""
    folder, domain = tmp_path_factory.mktemp("cells"), free_domain()
    models, outputs = _models(folder), {cell: folder / f"out_{cell.strip('/')}" for cell in CELLS}
    found = Both(models, outputs, {cell: Received() for cell in CELLS}, {}, {cell: [] for cell in CELLS}, {})
    with ExitStack() as stack:
        node = stack.enter_context(ros_context(domain))
        for cell in CELLS:
            _listen(node, cell, found.received[cell])
        node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: _note(found.diagnostics, m), 100)
        processes = [
            process for cell in CELLS for process in _started(stack, domain, cell, models[cell], outputs[cell])
        ]
        # Created before the clients whose answers come first, so that no request is sent twice.
        clients = {cell: node.create_client(PredictPush, f"{cell}/predict_push") for cell in CELLS}
        for cell in CELLS:
            found.listed[cell] = call(node.create_client(ListModels, f"{cell}/list_models"), ListModels.Request()).names
        for cell, recording in CELLS.items():
            paused = {"play.start_paused": True}  # until it has discovered the subscribers here
            stack.enter_context(replaying(domain, "-r", f"__ns:={cell}", recording=recording, rate=10.0, **paused))
        for cell in CELLS:
            acquaint(node, f"{cell}/push_validator")  # whose first residuals would else be lost
            acquaint(node, f"{cell}/push_replay")
            acquaint(node, f"{cell}/push_predictor")  # so that no request below is sent twice
            call(node.create_client(Resume, f"{cell}/push_replay/resume"), Resume.Request())
        for k in range(40):
            for cell, client in clients.items():
                found.answers[cell].append(call(client, _request(k), patience=START_TIMEOUT))
        for process in processes:
            process.wait_for_text(WRITTEN, 120.0)
        assert wait_until(lambda: len(found.diagnostics) >= 6 and all(_counted(found, cell) for cell in CELLS)), {
            cell: (_windows(found, cell), _served(found, cell), len(found.received[cell].residuals)) for cell in CELLS
        }
    return found


def _counted(both: Both, cell: str) -> bool:
    """Whether all residuals of a cell were received, and its diagnostics count all windows and requests."""
    total = _windows(both, cell)
    judged = both.diagnostics[f"{cell}/push_validator: validation"].get("robot windows") == str(total)
    return judged and _served(both, cell) >= total + 40 and len(both.received[cell].residuals) >= total


def _windows(both: Both, cell: str) -> int:
    return int(json.loads((both.outputs[cell] / "validation.json").read_text())["n_test"])


def _served(both: Both, cell: str) -> int:
    return int(both.diagnostics[f"{cell}/push_predictor: predictions"]["requests_served"])


def _models(folder: Path) -> dict[str, Path]:
    paths = {}
    for cell, recording in CELLS.items():
        data = [recording]
        model = train_model(
            load_data(data), load_rig_for(data), "gp", name="robot", options=TrainingOptions(n_train=30, mean="zero")
        )
        paths[cell] = folder / f"{cell.strip('/')}.pushmodel"
        save_model(model, paths[cell])
    return paths


def _listen(node: Any, cell: str, received: Received) -> None:
    deep = QoSProfile(depth=10_000)
    node.create_subscription(PushResidual, f"{cell}/push_residual", received.residuals.append, deep)
    node.create_subscription(PoseStamped, f"{cell}/slider/pose", received.sliders.append, deep, raw=True)
    node.create_subscription(PushRig, f"{cell}/rig", received.rigs.append, LATCHED)


def _note(diagnostics: dict[str, dict[str, str]], message: DiagnosticArray) -> None:
    for status in message.status:
        diagnostics[status.name] = {pair.key: pair.value for pair in status.values}


def _started(stack: ExitStack, domain: int, cell: str, model: Path, output: Path) -> Iterator[Any]:
    params = {"model": "robot", "output": output, "report": False, "diagnostics_period": 0.2}
    stack.enter_context(node_process("predict_server", domain=domain, namespace=cell, params={"models": [str(model)]}))
    yield stack.enter_context(node_process("push_validator", domain=domain, namespace=cell, params=params))


def _request(k: int) -> PredictPush.Request:
    return PredictPush.Request(velocity=0.02, contact=0.02 * k, angle=0.01 * k, duration=0.2)


def test_each_validator_scores_its_own_robot_with_its_own_server(both: Both):
    for cell, recording in CELLS.items():
        assert_same_as_offline(both.outputs[cell], both.models[cell], recording)


def test_answers_come_from_the_server_of_the_namespace(both: Both):
    means = {}
    for cell, path in both.models.items():
        inputs = np.array([[0.02, 0.02 * k, 0.01 * k] for k in range(40)])
        means[cell] = load_model(path).predict_rows(inputs, np.full(40, 0.2)).mean
        answered = np.array([answer.mean for answer in both.answers[cell]])
        assert np.allclose(answered, means[cell], rtol=0.0, atol=1e-5)
        assert both.listed[cell] == ["robot"]
    first, second = means.values()
    assert np.max(np.abs(first - second)) > 1e-3  # so it is not the other server's


def test_each_topic_carries_the_data_of_its_namespace(both: Both):
    for cell, recording in CELLS.items():
        recorded = {bytes(m.data) for m in open_bag(recording).messages() if m.topic.endswith("slider/pose")}
        assert both.received[cell].sliders and recorded >= set(map(bytes, both.received[cell].sliders))
        assert {rig.shape for rig in both.received[cell].rigs} == {load_rig_for([recording]).shape}
        windows = json.loads((both.outputs[cell] / "windows.json").read_text())["windows"]
        published = {(m.push_id, m.window) for m in both.received[cell].residuals}
        assert published == {(w["push_id"], w["window"]) for w in windows}
        bag = open_bag(both.outputs[cell] / "residuals")
        assert {deserialize_message(m.data, PushResidual).push_id for m in bag.messages()} == {p for p, _ in published}


def test_diagnostics_distinguish_the_robots(both: Both):
    names = sorted(both.diagnostics)
    ends = ("push_predictor: predictions", "push_replay: replay", "push_validator: validation")
    assert names == [f"{cell}/{end}" for cell in CELLS for end in ends]
    for cell in CELLS:
        total, judged = _windows(both, cell), both.diagnostics[f"{cell}/push_validator: validation"]
        assert judged["robot windows"] == str(total)
        # Once each, except requests repeated after 2 s without an answer.
        assert total + 40 <= _served(both, cell) <= total + 40 + int(judged["timeouts"])
