# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every service refuses bad input with the code of its reason, and answers the rest: the handlers, without a node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import drifting_models
import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseWithCovariance, Quaternion, Vector3
from std_msgs.msg import Header
from synthetic import square_pushes

from push_predictor import errors
from push_predictor.error_codes import ErrorCode, error_code
from push_predictor.errors import FrameError, PushPredictorError, RequestError
from push_predictor.geometry.frames import SAME_FRAME, SpatialPose
from push_predictor.models.store.model_file import save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import train_model
from push_predictor.nodes.server.services import (
    MAX_PUSHES,
    handle_load_model,
    handle_predict_push,
    handle_predict_push_batch,
    handle_predict_slider_pose,
    handle_rollout_pushes,
    handle_suggest_pushes,
)
from push_predictor_interfaces.action import SuggestPushes
from push_predictor_interfaces.msg import PushStep
from push_predictor_interfaces.srv import (
    LoadModel,
    PredictPush,
    PredictPushBatch,
    PredictSliderPose,
    RolloutPushes,
)

NAN = float("nan")
PUSH = {"velocity": 0.02, "contact": 0.1, "angle": 0.1, "duration": 0.2}


class WorldOnly:
    """The frames of a server without tf."""

    def pose_in_world(self, header: Any) -> SpatialPose:
        if header.frame_id != "world":
            raise FrameError("header.frame_id", header.frame_id, "'world'")
        return SAME_FRAME


def never_cancelled() -> None:
    """Let the request continue."""


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModelRegistry]:
    """A GP, one whose effect needs the elapsed time, and one that learns nothing."""
    place = tmp_path_factory.mktemp("models")
    gp = train_model(*square_pushes(60), "gp", name="gp")
    save_model(gp, place / "a_gp.model")
    table = drifting_models.pushes(20, 0)
    base = train_model(table, gp.rig, "analytical", name="plain")
    extended = drifting_models.extended(base, drifting_models.slippery(0.1))
    save_model(replace(extended, name="drifting"), place / "drifting.model")
    save_model(base, place / "plain.model")
    loaded = ModelRegistry()
    assert loaded.load_all([str(place)]) == []
    yield loaded


def push(**change: Any) -> PredictPush.Request:
    return PredictPush.Request(**{**PUSH, **change})


def batch(**change: Any) -> PredictPushBatch.Request:
    usual = {"velocity": [0.02, 0.02], "contact": [0.1, 0.2], "angle": [0.1, 0.2], "duration": 0.2}
    return PredictPushBatch.Request(**{**usual, **change})


def pose(frame: str = "world", **change: Any) -> PredictSliderPose.Request:
    usual = {
        "slider": Pose(orientation=Quaternion(w=1.0)),
        "pusher": Point(x=-0.045 - 0.00475, y=0.01),
        "pusher_velocity": Vector3(x=0.02),
        "duration": 0.2,
    }
    return PredictSliderPose.Request(header=Header(frame_id=frame), **{**usual, **change})


def slider(y: float = 0.0, w: float = 1.0, turn_variance: float = 0.0) -> PoseWithCovariance:
    pose = Pose(position=Point(y=y), orientation=Quaternion(w=w))
    return PoseWithCovariance(pose=pose, covariance=[*np.zeros(35), turn_variance])


def steps(*changes: dict[str, float], frame: str = "world", **others: Any) -> RolloutPushes.Request:
    pushes = [PushStep(**{**PUSH, **change}) for change in changes]
    return RolloutPushes.Request(header=Header(frame_id=frame), steps=pushes, **{"slider": slider(), **others})


def suggestion(**fields: Any) -> SuggestPushes.Goal:
    return SuggestPushes.Goal(count=1, **fields)


HANDLERS: dict[type, Callable[[ModelRegistry, Any, Any], None]] = {
    PredictPush: handle_predict_push,
    PredictPushBatch: partial(handle_predict_push_batch, never_cancelled),
    PredictSliderPose: partial(handle_predict_slider_pose, WorldOnly()),
    RolloutPushes: partial(handle_rollout_pushes, never_cancelled, WorldOnly()),
    SuggestPushes: partial(handle_suggest_pushes, never_cancelled),
    LoadModel: handle_load_model,
}
ELAPSED = {"covariate_names": ["elapsed_time"], "covariate_values": [NAN]}
REQUEST, MODEL, COVARIATES = "INVALID_REQUEST", "UNKNOWN_MODEL", "INVALID_COVARIATES"
LARGE, FRAME, CONTACT, FILE = "TOO_LARGE", "INVALID_FRAME", "NO_CONTACT", "INVALID_FILE"
BAD: list[tuple[Any, Any, str, str]] = [
    (PredictPush, push(angle=NAN), REQUEST, "angle: nan"),
    (PredictPush, push(duration=-0.2), REQUEST, "duration: -0.2"),
    (PredictPush, push(push_residual=[0.1] * 4), REQUEST, "push_residual: [0.1, 0.1, 0.1, 0.1]"),
    (PredictPush, push(push_residual=[0.0, NAN, 0.0]), REQUEST, "push_residual: [0.0, nan, 0.0]"),
    (PredictPush, push(push_residual=[0.1] * 33), REQUEST, "push_residual: [0.1, 0.1, "),
    (PredictPush, push(model="nobody"), MODEL, "model: 'nobody' is not accepted, give one of gp, drifting, plain"),
    (PredictPush, push(model="drifting"), COVARIATES, "covariate elapsed_time: 'missing'"),
    (PredictPush, push(model="drifting", **ELAPSED), COVARIATES, "covariate elapsed_time: nan"),
    (PredictPush, push(**{**ELAPSED, "covariate_names": ["other"]}), COVARIATES, "covariate other: nan"),
    (PredictPush, push(covariate_names=["a"] * 2, covariate_values=[1.0, 1.0]), COVARIATES, "covariate_names"),
    (PredictPushBatch, batch(angle=[0.1, 2.0]), REQUEST, "angle[1]: 2.0"),
    (PredictPushBatch, batch(duration=3.0), REQUEST, "duration: 3.0"),
    (PredictPushBatch, batch(angle=[0.1]), REQUEST, "angle length: 1"),
    (PredictPushBatch, batch(contact=[0.1]), REQUEST, "contact length: 1"),
    (PredictPushBatch, batch(model="nobody"), MODEL, "model: 'nobody'"),
    (PredictPushBatch, batch(covariate_names=["a"]), COVARIATES, "covariate_values length: 0"),
    (PredictPushBatch, batch(velocity=np.full(MAX_PUSHES + 1, 0.02)), LARGE, "velocity length: 1000001"),
    (PredictSliderPose, pose(duration=NAN), REQUEST, "duration: nan"),
    (PredictSliderPose, pose(model="nobody"), MODEL, "model: 'nobody'"),
    (PredictSliderPose, pose(frame="camera"), FRAME, "header.frame_id: 'camera'"),
    (PredictSliderPose, pose(pusher=Point(x=-0.2)), CONTACT, "pusher: (-0.2, 0.0)"),
    (PredictSliderPose, pose(pusher_velocity=Vector3(x=-0.02)), CONTACT, "pusher_velocity: (-0.02, 0.0)"),
    (PredictSliderPose, pose(pusher_velocity=Vector3()), REQUEST, "pusher_velocity: (0.0, 0.0)"),
    (PredictSliderPose, pose(covariate_names=["slider_x"], covariate_values=[1.0]), COVARIATES, "covariate s"),
    (RolloutPushes, steps({}, {"contact": 1.0}), REQUEST, "steps[1].contact: 1.0"),
    (RolloutPushes, steps({"velocity": 1e300}, model="plain"), REQUEST, "steps[0].velocity: 1e+300"),
    (RolloutPushes, steps({"duration": 0.5}), REQUEST, "steps[0].duration: 0.5"),
    (RolloutPushes, steps({}, model="nobody"), MODEL, "model: 'nobody'"),
    (RolloutPushes, steps({}, frame=""), FRAME, "header.frame_id: ''"),
    (RolloutPushes, steps({}, slider=slider(y=NAN)), REQUEST, "slider.pose.position.y: nan"),
    (RolloutPushes, steps({}, slider=slider(w=3.0)), REQUEST, "slider.pose.orientation norm: 3.0"),
    (RolloutPushes, steps({}, slider=slider(turn_variance=NAN)), REQUEST, "slider.covariance[35]: nan"),
    (RolloutPushes, steps({}, slider=slider(turn_variance=-1.0)), REQUEST, "slider.covariance: [["),
    (RolloutPushes, steps({}, model="drifting"), COVARIATES, "steps[0].covariate elapsed_time: 'missing'"),
    (
        RolloutPushes,
        steps({}, {}, {}, model="drifting", **{**ELAPSED, "covariate_values": [1.0, 2.0]}),
        COVARIATES,
        "covariate_values length: 2",
    ),
    (RolloutPushes, steps({}, covariate_names=["slider_x"], covariate_values=[1.0]), COVARIATES, "covariate_n"),
    (RolloutPushes, steps({}, particles=100_001), LARGE, "particles: 100001 is not accepted, give at most 100000"),
    (RolloutPushes, steps({"duration": 1000.0}), LARGE, "steps: '5000 windows'"),
    (SuggestPushes, SuggestPushes.Goal(count=0), REQUEST, "count: 0"),
    (SuggestPushes, SuggestPushes.Goal(count=201), REQUEST, "count: 201"),
    (SuggestPushes, suggestion(speed=[0.1]), REQUEST, "speed length: 1 is not accepted, give 2 values, or none"),
    (SuggestPushes, suggestion(angle=[0.0, 0.1, 0.2, 0.3]), REQUEST, "angle length: 4"),
    (SuggestPushes, suggestion(excluded=[0.1, 0.2, 0.3]), REQUEST, "excluded length: 3"),
    (SuggestPushes, suggestion(transfer_speed=-0.1), REQUEST, "transfer_speed: -0.1"),
    (SuggestPushes, suggestion(speed=[0.1, 1e308]), REQUEST, "speed: (0.1, 1e+308) is not accepted, give at most"),
    (SuggestPushes, suggestion(model="plain"), REQUEST, "model: 'plain' is not accepted, give one with something to"),
    (SuggestPushes, suggestion(model="nobody"), MODEL, "model: 'nobody'"),
    (SuggestPushes, suggestion(covariate_names=["a"]), COVARIATES, "covariate_values length: 0"),
    (LoadModel, LoadModel.Request(), REQUEST, "path: ''"),
    (LoadModel, LoadModel.Request(path="/no/such.model"), FILE, "/no/such.model: cannot be read"),
]


@pytest.mark.parametrize(("service", "request_", "name", "begins"), BAD)
def test_bad_input_is_refused_by_field_and_value_with_a_code_that_the_response_declares(
    registry: ModelRegistry, service: Any, request_: Any, name: str, begins: str
) -> None:
    answer = service.Result if service is SuggestPushes else service.Response
    with pytest.raises(PushPredictorError) as caught:
        HANDLERS[service](registry, request_, answer())
    assert str(caught.value).startswith(begins)
    code = error_code(caught.value)
    assert code.name == name, caught.value
    assert getattr(answer, name) == code


def test_good_input_has_no_error(registry: ModelRegistry) -> None:
    for service, good in ((PredictPush, push()), (PredictPushBatch, batch()), (PredictSliderPose, pose())):
        HANDLERS[service](registry, good, response := service.Response())
        assert response.success and response.error_code == response.NONE == 0 and response.message == ""


def test_a_push_outside_the_domain_is_answered_and_the_message_states_it(registry: ModelRegistry) -> None:
    fast = {"pusher_velocity": Vector3(x=0.2)}
    for service, request in ((PredictPush, push(velocity=0.2)), (PredictSliderPose, pose(**fast))):
        HANDLERS[service](registry, request, response := service.Response())
        assert response.success and response.error_code == response.NONE and not response.in_domain
        assert response.message.startswith("out of domain: velocity 0.2 m/s, training covers ")
    HANDLERS[PredictPushBatch](registry, batch(velocity=[0.02, 0.2]), response := PredictPushBatch.Response())
    assert response.message.startswith("out of domain: 1 of 2 pushes, first push 1: velocity 0.2 m/s")
    HANDLERS[RolloutPushes](registry, steps({"velocity": 0.2}), response := RolloutPushes.Response())
    assert response.success and response.message.startswith("out of domain: 100 % of the samples")


def test_duration_zero_means_the_models_own_window(registry: ModelRegistry) -> None:
    own = registry.get("gp").model.usual_duration
    for service, ask in (
        (PredictPush, lambda duration: push(duration=duration)),
        (PredictPushBatch, lambda duration: batch(duration=duration)),
        (PredictSliderPose, lambda duration: pose(duration=duration)),
        (RolloutPushes, lambda duration: steps({}, {"duration": duration})),
    ):
        zero, given = service.Response(), service.Response()
        HANDLERS[service](registry, ask(0.0), zero)
        HANDLERS[service](registry, ask(own), given)
        assert zero.success and zero == given


def test_the_stamp_after_a_push_of_duration_zero_is_a_window_later(registry: ModelRegistry) -> None:
    request = pose(duration=0.0)
    request.header.stamp.sec = 100
    HANDLERS[PredictSliderPose](registry, request, response := PredictSliderPose.Response())
    assert response.slider_after.header.stamp.nanosec == round(1e9 * registry.get("gp").model.usual_duration)


def test_a_rollout_takes_covariates_for_each_step_or_for_all(registry: ModelRegistry) -> None:
    def after(*values: float) -> list[PoseWithCovariance]:
        named = {"covariate_names": ["elapsed_time"], "covariate_values": list(values)}
        response = RolloutPushes.Response()
        HANDLERS[RolloutPushes](registry, steps({"angle": 0.5}, {"angle": 0.5}, model="drifting", **named), response)
        return list(response.poses)

    assert after(900.0) == after(900.0, 900.0)
    assert after(900.0, 0.0)[0] == after(900.0)[0] != after(0.0)[0]
    assert after(900.0, 0.0)[1] != after(900.0)[1]


def test_every_error_of_the_package_has_a_code() -> None:
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, PushPredictorError)]
    for kind in kinds:
        one = kind("field", 1, "accepted") if issubclass(kind, RequestError) else kind("why")
        assert error_code(one) not in (ErrorCode.NONE, ErrorCode.INTERNAL_ERROR)
    assert error_code(ValueError("why")) is ErrorCode.INTERNAL_ERROR
    assert error_code(PermissionError("why")) is ErrorCode.INVALID_FILE
