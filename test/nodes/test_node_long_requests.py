# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What predict_server still does while long requests are computed: everything."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Event
from time import sleep

import pytest
import ros_harness as harness
from action_bench import ActionGoal
from lifecycle_msgs.msg import Transition
from rclpy.action import ActionClient
from server_bench import hosted_server_of
from synthetic import square_pushes

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.nodes import predict_server
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
