# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What predict_server still does while long requests are computed: everything."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Event
from time import sleep

import numpy as np
import pytest
import ros_harness as harness
from action_bench import ActionGoal
from action_msgs.msg import GoalStatus
from lifecycle_msgs.msg import Transition
from rclpy.action import ActionClient
from server_bench import hosted_server_of
from synthetic import square_pushes

from msg_adapters.predictions import PushQuery, query_to_batch_request
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes import predict_server
from push_predictor.nodes.server.services import MAX_EXACT
from push_predictor_interfaces.action import SuggestPushes
from push_predictor_interfaces.srv import PredictPushBatch, RolloutPushes

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    table, rig = square_pushes(60)
    path = tmp_path_factory.mktemp("models") / "a.model"
    save_model(train_model(table, rig, "analytical", name="analytical"), path)
    return path


def test_parameters_lifecycle_loading_and_single_pushes_do_not_wait_for_long_requests(
    model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The long requests last until they are cancelled: by the deactivation, which happens meanwhile."""
    begun = {name: Event() for name in ("predict_push_batch", "rollout_pushes", "suggest_pushes")}

    def until_cancelled(name: str) -> Callable[..., None]:
        def handle(check_cancelled: Callable[[], None], *_: object) -> None:
            begun[name].set()
            while True:
                check_cancelled()
                sleep(0.01)

        return handle

    for name in begun:
        monkeypatch.setattr(predict_server, f"handle_{name}", until_cancelled(name))
    with hosted_server_of([model]) as server:
        kinds = {PredictPushBatch: "predict_push_batch", RolloutPushes: "rollout_pushes"}
        clients = [server.node.create_client(kind, name) for kind, name in kinds.items()]
        assert all(client.wait_for_service(10.0) for client in clients)
        waiting = [client.call_async(client.srv_type.Request()) for client in clients]
        suggested = ActionGoal(
            server.node, ActionClient(server.node, SuggestPushes, "suggest_pushes"), SuggestPushes.Goal()
        )
        assert all(each.wait(30.0) for each in begun.values())
        assert server.set("trace_alpha", 0.02).successful
        assert server.push().success
        assert server.load(str(model), "second").success and list(server.list().names) == ["analytical", "second"]
        assert server.load(str(model), "third", make_default=True).success and server.list().default_model == "third"
        assert not any(each.done() for each in waiting) and not suggested.ended
        assert server.change(Transition.TRANSITION_DEACTIVATE)
        assert harness.wait_until(lambda: all(each.done() for each in waiting))
        assert {each.result().message for each in waiting} == {"the node is inactive"}
        assert suggested.end()[1].message == "the node is inactive"


@pytest.fixture(scope="module")
def learnt_and_slow(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A GP, the default, and the prior: a push of the prior computes the longest, 0.1 ms of processor time."""
    folder, (table, rig) = tmp_path_factory.mktemp("models"), square_pushes(60)
    none = table.take(np.arange(0))
    models = [
        train_model(table, rig, "gp", name="gp", options=TrainingOptions(mean="zero")),
        train_model(none, rig, "prior", name="prior"),
    ]
    paths = [folder / f"{model.name}.model" for model in models]
    for model, path in zip(models, paths, strict=True):
        save_model(model, path)
    return paths


def test_everything_else_is_answered_before_a_batch_of_pushes_without_a_table(learnt_and_slow: list[Path]) -> None:
    """As many as are accepted. That the deactivation ends the batch shows that it still ran."""
    rng = np.random.default_rng(0)
    inputs = rng.uniform([0.01, 0.0, -1.0], [0.05, 1.0, 1.0], (MAX_EXACT, 3))
    request = query_to_batch_request(PushQuery("prior", inputs, 0.2, {}))
    with hosted_server_of(learnt_and_slow, default_model="gp") as server:
        client = server.node.create_client(PredictPushBatch, "predict_push_batch")
        suggest = ActionClient(server.node, SuggestPushes, "suggest_pushes")
        assert client.wait_for_service(10.0) and suggest.wait_for_server(harness.START_TIMEOUT)
        goal = ActionGoal(server.node, suggest, SuggestPushes.Goal(count=200))
        batch = harness.in_spin(server.node, lambda: client.call_async(request))

        def while_it_runs(answered: bool, what: str) -> None:
            assert answered and not batch.done(), what

        while_it_runs(server.set("trace_alpha", 0.02).successful, "a parameter")
        while_it_runs(server.push().success, "a push")
        while_it_runs(server.push(model="prior").success, "a push of the same model")
        while_it_runs(server.state() == "active", "the state")
        cancelled = harness.in_spin(server.node, goal.handle.cancel_goal_async)
        while_it_runs(harness.wait_until(cancelled.done), "a cancelling")
        while_it_runs(goal.end()[0] == GoalStatus.STATUS_CANCELED, "the end of the goal")
        assert server.change(Transition.TRANSITION_DEACTIVATE)
        assert harness.wait_until(batch.done)
        assert batch.result().message == "the node is inactive"
