# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bad requests to every service: refused by field and value; the next request is answered.

Node parameters out of range: rejected at start and when they are set.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_harness as harness
from drifting_models import extended, pushes, slippery
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from server_bench import Server, hosted_server_of
from synthetic import square_rig

from msg_adapters.predictions import PushQuery, query_to_batch_request, query_to_request
from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import FARTHEST, PushRequest, check_request, check_requests
from push_predictor.models.store.model_file import save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes import parameter_tables
from push_predictor.nodes.parameters import Param, declare
from push_predictor.nodes.server.services import handle_predict_push, handle_predict_push_batch
from push_predictor_interfaces.srv import PredictPush, PredictPushBatch, PredictSliderPose, RolloutPushes

NAN, INF = math.nan, math.inf
TABLES = {
    "predict_server": parameter_tables.PREDICT_SERVER,
    "push_validator": parameter_tables.PUSH_VALIDATOR,
    "push_recorder": parameter_tables.PUSH_RECORDER,
    "push_replay": parameter_tables.PUSH_REPLAY,
}


@pytest.fixture(scope="module")
def models() -> dict[str, PushModel]:
    rows, rig = pushes(25), square_rig()
    found = {
        kind: train_model(rows, rig, kind, name=kind, options=TrainingOptions(mean="zero"))
        for kind in ("analytical", "vhgp")
    }
    return {**found, "drifting": replace(extended(found["vhgp"], slippery(0.1, 0.05)), name="drifting")}


@pytest.fixture(scope="module")
def server(models: dict[str, PushModel], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("models")
    for name, model in models.items():
        save_model(model, folder / f"{name}.model")
    with hosted_server_of([folder], default_model="vhgp") as running:
        yield running


# --- through the services -----------------------------------------------------------------------------------------


REQUESTS = {
    "predict_push": PredictPush,
    "predict_push_batch": PredictPushBatch,
    "predict_slider_pose": PredictSliderPose,
    "rollout_pushes": RolloutPushes,
}


@pytest.mark.parametrize("name", REQUESTS)
def test_a_bad_request_gets_reason_and_code_and_the_next_one_its_answer(name: str, server: Server) -> None:
    """What each service refuses: test_error_codes."""
    kind, good = REQUESTS[name], list(server.push().mean)
    client = server.node.create_client(kind, name)
    response = harness.call(client, kind.Request(model="nobody"))
    assert not response.success and response.message.startswith("model: 'nobody' is not accepted, give one of ")
    assert response.error_code == response.UNKNOWN_MODEL
    assert list(server.push().mean) == good


@pytest.mark.parametrize("size", [10**5, pytest.param(10**6, marks=pytest.mark.long)])
def test_empty_and_huge_batches_are_answered(server: Server, size: int) -> None:
    good = list(server.push().mean)
    assert server.batch([]).success
    rng = np.random.default_rng(0)
    many = np.column_stack([np.full(size, 0.02), rng.random(size), rng.uniform(-0.9, 0.9, size)])
    asked = server._clients["predict_push_batch"].call_async(query_to_batch_request(PushQuery("", many, 0.2, {})))
    assert harness.wait_until(asked.done, 300.0)
    response = asked.result()
    assert response.success and len(response.in_domain) == size
    mean = np.frombuffer(response.mean).reshape(-1, 3)
    some = rng.integers(0, size, 20)
    one_by_one = [server.push(many[k]).mean for k in some]
    np.testing.assert_allclose(mean[some], one_by_one, rtol=1e-9, atol=1e-12)
    del response, mean
    assert list(server.push().mean) == good


# --- in the library -----------------------------------------------------------------------------------------------


def test_rejects_paths_over_one_metre(models: dict[str, PushModel]) -> None:
    """Mechanics integrated along a path without limit would block the service."""
    for name in ("analytical", "drifting", "vhgp"):
        given = dict.fromkeys(models[name].needs, 1.0)
        check_request(models[name], PushRequest(FARTHEST / 0.2, 0.1, 0.2, 0.2, given))
        with pytest.raises(RequestError, match=r"^velocity: 5.1 is not accepted, give at most 5 m/s for 0.2 s"):
            check_request(models[name], PushRequest(5.1, 0.1, 0.2, 0.2, given))
        columns = {key: np.ones(2) for key in given}
        with pytest.raises(RequestError, match=r"^velocity\[1\]: 1e\+300 is not accepted"):
            check_requests(models[name], np.array([[0.02, 0.1, 0.2], [1e300, 0.1, 0.2]]), 0.2, columns)


def test_push_without_a_finite_prediction_is_refused(
    models: dict[str, PushModel], tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    registry = ModelRegistry()
    save_model(models["drifting"], tmp_path / "drifting")
    registry.load(tmp_path / "drifting")
    push, time = np.array([0.02, 0.1, 0.8]), 1.7e308
    refused = "drifting has no finite prediction"
    with pytest.raises(PushPredictorError, match=f"push 0: {refused}"):
        one = query_to_request("drifting", push, 0.2, {"elapsed_time": time})
        handle_predict_push(registry, one, PredictPush.Response())
    both = PushQuery("drifting", np.array([push, push]), 0.2, {"elapsed_time": np.array([1.0, time])})
    with pytest.raises(PushPredictorError, match=f"push 1: {refused}"):
        handle_predict_push_batch(lambda: None, registry, query_to_batch_request(both), PredictPushBatch.Response())


# --- parameters ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def context() -> Iterator[Context]:
    context = Context()
    context.init(args=[], domain_id=harness.free_domain())
    yield context
    context.try_shutdown()


@contextmanager
def plain_node(context: Context, given: dict[str, Any] | None = None) -> Iterator[Node]:
    overrides = [Parameter(name, value=value) for name, value in (given or {}).items()]
    silent = {"start_parameter_services": False, "enable_rosout": False}
    node = Node("parameters", context=context, parameter_overrides=overrides, **silent)
    try:
        yield node
    finally:
        node.destroy_node()


def wrong_values(param: Param) -> list[Any]:
    """Values that a parameter must not take."""
    if isinstance(param.default, bool):
        return [3]
    if isinstance(param.default, str):
        return [3, "none of these"] if param.choices else [3]
    if isinstance(param.default, list):
        return ["a text"]
    beyond = [] if param.low is None else [type(param.default)(param.low) - 1]
    beyond += [] if param.high is None else [type(param.default)(param.high) + 1]
    return [*beyond, "a text", *([NAN, INF] if isinstance(param.default, float) else [])]


@pytest.mark.parametrize("name", TABLES)
def test_rejects_parameters_out_of_range_at_start(name: str, context: Context) -> None:
    """One value for each parameter; the others when they are set."""
    for param in TABLES[name]:
        value = wrong_values(param)[0]
        with plain_node(context, {param.name: value}) as node, pytest.raises(RequestError) as caught:
            declare(node, TABLES[name])
        assert str(caught.value) == f"{param.name}: {value!r} is not accepted, give {param.accepted}"
        assert all(param.allows(type(param.default)(each)) for each in (param.low, param.high) if each is not None)


@pytest.mark.parametrize("name", TABLES)
def test_rejects_parameters_out_of_range_when_set(name: str, context: Context) -> None:
    with plain_node(context) as node:
        declare(node, TABLES[name])
        for param in TABLES[name]:
            before = node.get_parameter(param.name).value
            for value in wrong_values(param):
                result = node.set_parameters([Parameter(param.name, value=value)])[0]
                assert not result.successful, (param.name, value)
                assert param.name in result.reason or "Wrong parameter type" in result.reason, (param.name, result)
            assert node.get_parameter(param.name).value == before
            if param.read_only:
                assert not node.set_parameters([Parameter(param.name, value=before)])[0].successful
