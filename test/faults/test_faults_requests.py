# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bad requests to every service: refused by field and value; the next request is answered.

Node parameters out of range: rejected at start and when they are set.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import ros_harness as harness
from drifting_models import extended, pushes, slippery
from geometry_msgs.msg import Point, Pose, PoseWithCovariance, Quaternion, Vector3
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from server_bench import Server, hosted_server_of
from std_msgs.msg import Header
from synthetic import square_rig

from msg_adapters.predictions import PushQuery, query_to_batch_request, query_to_request
from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import FARTHEST, PushRequest, check_request, check_requests
from push_predictor.models.store.model_file import save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes import recorder_parameters
from push_predictor.nodes.parameters import Param, declare
from push_predictor.nodes.replay import parameters as replay_parameters
from push_predictor.nodes.server import parameters as server_parameters
from push_predictor.nodes.server.services import handle_predict_push, handle_predict_push_batch
from push_predictor.nodes.validator import parameters as validator_parameters
from push_predictor_interfaces.msg import PushStep
from push_predictor_interfaces.srv import PredictPush, PredictPushBatch, PredictSliderPose, RolloutPushes

NAN, INF = math.nan, math.inf
TABLES = {
    "predict_server": server_parameters.PARAMETERS,
    "push_validator": validator_parameters.PARAMETERS,
    "push_recorder": recorder_parameters.PARAMETERS,
    "push_replay": replay_parameters.PARAMETERS,
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
        running.extra = {
            kind.Request: running.node.create_client(kind, name)
            for kind, name in ((PredictSliderPose, "predict_slider_pose"), (RolloutPushes, "rollout_pushes"))
        }
        yield running


# --- through the services -----------------------------------------------------------------------------------------

BAD: list[tuple[str, dict[str, Any]]] = [
    ("velocity: nan", {"push": (NAN, 0.1, 0.2)}),
    ("velocity: inf", {"push": (INF, 0.1, 0.2)}),
    ("velocity: -0.02", {"push": (-0.02, 0.1, 0.2)}),
    ("velocity: 0.0", {"push": (0.0, 0.1, 0.2)}),
    ("contact: 1.0", {"push": (0.02, 1.0, 0.2)}),
    ("contact: -inf", {"push": (0.02, -INF, 0.2)}),
    ("angle: 1.6", {"push": (0.02, 0.1, 1.6)}),
    ("angle: nan", {"push": (0.02, 0.1, NAN)}),
    ("duration: nan", {"duration": NAN}),
    ("duration: 3.0", {"duration": 3.0}),
    ("duration: -0.2", {"duration": -0.2}),
    ("velocity: 1e+300", {"push": (1e300, 0.1, 0.2), "model": "analytical"}),
    ("velocity: 0.02", {"duration": 1e9, "model": "analytical"}),
    ("velocity: 1000.0", {"push": (1000.0, 0.1, 0.2), "model": "drifting", "covariates": {"elapsed_time": 1.0}}),
    ("model: 'nobody'", {"model": "nobody"}),
    ("covariate elapsed_time: 'missing'", {"model": "drifting"}),
    ("covariate elapsed_time: nan", {"model": "drifting", "covariates": {"elapsed_time": NAN}}),
    ("covariate other: inf", {"covariates": {"other": INF}}),
]


def test_rejects_bad_requests_by_field_and_value_and_continues(server: Server) -> None:
    """Median response times are printed only, because the machine's load varies."""
    good, before = answered(server)
    for refusal, asked in BAD:
        asked = {"push": (0.02, 0.1, 0.2), **asked}
        response = server.push(**asked)
        assert not response.success and not np.any(response.mean), refusal
        assert response.message.startswith(f"{refusal} is not accepted, give "), response
        batch = server.batch(
            [(0.02, 0.1, 0.2), asked["push"]], **{k: doubled(v) for k, v in asked.items() if k != "push"}
        )
        assert not batch.success and not len(batch.mean), refusal
        assert " is not accepted, give " in batch.message and refusal.split(":")[0] in batch.message
        assert list(server.push().mean) == good
    last, after = answered(server)
    assert last == good
    print(f"an answer took {1e6 * before:.0f} us before, {1e6 * after:.0f} us after: {after / before:.2f}")


def doubled(value: Any) -> Any:
    """The covariates of one push as those of two."""
    return {name: np.full(2, number) for name, number in value.items()} if isinstance(value, dict) else value


def answered(server: Server, count: int = 20) -> tuple[list[float], float]:
    """The mean predicted for a good push, and the median response time (s)."""
    taken, mean = [], []
    for _ in range(count):
        begun = time.perf_counter()
        mean = list(server.push().mean)
        taken.append(time.perf_counter() - begun)
    return mean, statistics.median(taken)


def pose_request(**change: Any) -> PredictSliderPose.Request:
    fields = {
        "header": Header(frame_id="world"),
        "slider": Pose(orientation=Quaternion(w=1.0)),
        "pusher": Point(x=-0.04975, y=0.01),
        "pusher_velocity": Vector3(x=0.02, y=0.002),
        "duration": 0.2,
    }
    return PredictSliderPose.Request(**{**fields, **change})


def rollout_request(**change: Any) -> RolloutPushes.Request:
    step = {"velocity": 0.02, "contact": 0.1, "angle": 0.2, "duration": 0.6}
    slider = PoseWithCovariance(pose=Pose(orientation=Quaternion(w=1.0)))
    model = change.pop("model", "")
    return RolloutPushes.Request(
        header=Header(frame_id="world"),
        slider=slider,
        particles=10,
        model=model,
        steps=[PushStep(**{**step, **change})],
    )


@pytest.mark.parametrize(
    ("refusal", "request_"),
    [
        ("", pose_request()),
        ("pusher_velocity.x: nan", pose_request(pusher_velocity=Vector3(x=NAN))),
        ("slider.position.x: inf", pose_request(slider=Pose(position=Point(x=INF), orientation=Quaternion(w=1.0)))),
        ("duration: inf", pose_request(duration=INF)),
        ("velocity: 1e+200", pose_request(pusher_velocity=Vector3(x=1e200), model="analytical")),
        ("model: 'nobody'", pose_request(model="nobody")),
        ("", rollout_request()),
        ("steps[0].velocity: nan", rollout_request(velocity=NAN)),
        ("steps[0].angle: 1.6", rollout_request(angle=1.6)),
        ("steps[0].duration: inf", rollout_request(duration=INF)),
        ("steps[0].duration: 1e+300", rollout_request(duration=1e300)),
        ("steps[0].velocity: 1e+300", rollout_request(velocity=1e300, model="analytical")),
        ("steps[0].duration: nan", rollout_request(duration=NAN, model="analytical")),
    ],
)
def test_rejects_bad_poses_and_rollouts(server: Server, refusal: str, request_: Any) -> None:
    good = list(server.push().mean)
    response = harness.call(server.extra[type(request_)], request_)
    assert response.success == (not refusal), response.message
    assert not refusal or response.message.startswith(f"{refusal} is not accepted, give "), response.message
    assert list(server.push().mean) == good


@pytest.mark.parametrize("size", [10**5, pytest.param(10**6, marks=pytest.mark.long)])
def test_empty_and_huge_batches_are_answered(server: Server, size: int) -> None:
    good, before = answered(server)
    assert server.batch([]).success
    rng = np.random.default_rng(0)
    many = np.column_stack([np.full(size, 0.02), rng.random(size), rng.uniform(-0.9, 0.9, size)])
    asked = server._clients["predict_push_batch"].call_async(query_to_batch_request(PushQuery("", many, 0.2, {})))
    _, during = answered(server, 30)
    assert harness.wait_until(asked.done, 300.0)
    response = asked.result()
    assert response.success and len(response.in_domain) == size
    mean = np.frombuffer(response.mean).reshape(-1, 3)
    some = rng.integers(0, size, 20)
    one_by_one = [server.push(many[k]).mean for k in some]
    np.testing.assert_allclose(mean[some], one_by_one, rtol=1e-9, atol=1e-12)
    del response, mean
    last, after = answered(server)
    assert last == good
    print(f"an answer took {1e6 * before:.0f} us before, {1e6 * during:.0f} meanwhile, {1e6 * after:.0f} after")


# --- in the library -----------------------------------------------------------------------------------------------


def test_rejects_paths_over_one_metre_where_mechanics_is_integrated(models: dict[str, PushModel]) -> None:
    """A path without limit would block the service."""
    for name in ("analytical", "drifting"):
        given = dict.fromkeys(models[name].needs, 1.0)
        check_request(models[name], PushRequest(FARTHEST / 0.2, 0.1, 0.2, 0.2, given))
        with pytest.raises(RequestError, match=r"^velocity: 5.1 is not accepted, give at most 5 m/s for 0.2 s"):
            check_request(models[name], PushRequest(5.1, 0.1, 0.2, 0.2, given))
        columns = {key: np.ones(2) for key in given}
        with pytest.raises(RequestError, match=r"^velocity\[1\]: 1e\+300 is not accepted"):
            check_requests(models[name], np.array([[0.02, 0.1, 0.2], [1e300, 0.1, 0.2]]), 0.2, columns)
    check_request(models["vhgp"], PushRequest(5.1, 0.1, 0.2, 0.2))  # a learned model integrates nothing


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
    cases = [(param, value) for param in TABLES[name] for value in wrong_values(param)]
    for param, value in cases:
        with plain_node(context, {param.name: value}) as node, pytest.raises(RequestError) as caught:
            declare(node, TABLES[name])
        assert str(caught.value) == f"{param.name}: {value!r} is not accepted, give {param.accepted}"
    assert len(cases) > 10


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
