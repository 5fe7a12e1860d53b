# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The services of predict_server, and suggest_pushes: from a request and the loaded models to a response.

A handler fills the response, or raises a PushPredictorError that states what is wrong with the request. Long ones call
check_cancelled between their parts; it raises when nobody waits any more.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.time import Time

from msg_adapters.predictions import (
    PushQuery,
    covariates_of_push,
    extend_batch_response,
    fill_response,
    fill_suggest_response,
    limits_from_request,
    push_from_request,
    query_from_batch_request,
    residual_from_request,
)
from msg_adapters.rigs import model_to_info
from msg_adapters.slider_poses import (
    fill_rollout_response,
    fill_slider_response,
    pose_of_transform,
    steps_from_request,
    world_push,
    world_slider,
    world_start,
)
from push_predictor.design.batch import suggest_pushes
from push_predictor.errors import FrameError, PredictionError, RequestError, TooLargeError
from push_predictor.geometry.frames import SAME_FRAME, SpatialPose
from push_predictor.models.prediction import NOT_FINITE, Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.request import (
    PushRequest,
    check_request,
    check_requests,
    domain_remark,
    own_window,
    with_own_window,
)
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.planning.given_earlier import EarlierWindows, given_earlier
from push_predictor.planning.persistence import persistence_of
from push_predictor.planning.rollout import PARTICLES, rollout
from push_predictor.planning.slider_pose import slider_after
from push_predictor.types import Array

MAX_PUSHES = 1_000_000  # per batch: the server needs up to 0.6 kB for each while it answers
MAX_EXACT = 50_000  # of these outside a table: up to a millisecond each
CHUNK = 4096  # rows predicted at once: the length of a batch must not determine the memory of a prediction


class RequestFrames:
    """Looks frames up in tf; a lookup never waits. world: name of the frame in which sliders lie flat."""

    def __init__(self, node: Node, world: str) -> None:
        self.world = world
        self._tf = _imported_tf()
        if self._tf is not None:
            self._buffer = self._tf.Buffer()
            self._listener = self._tf.TransformListener(self._buffer, node)

    def pose_in_world(self, header: Any) -> SpatialPose:
        """The pose in the world of a header's frame at the header's stamp; a zero stamp means the latest.

        Raises FrameError for an empty frame and for one that tf does not connect to the world.
        """
        if header.frame_id == self.world:
            return SAME_FRAME
        if not header.frame_id:
            raise FrameError("header.frame_id", "", f"the frame of the poses, such as {self.world!r}")
        if header.frame_id.lstrip("/") == self.world:
            raise FrameError("header.frame_id", header.frame_id, f"{self.world!r}, without a slash")
        if self._tf is None:
            raise FrameError("header.frame_id", header.frame_id, f"{self.world!r}; tf2_ros is not installed")
        return self._looked_up(self._tf, header)

    def _looked_up(self, tf: Any, header: Any) -> SpatialPose:
        try:
            found = self._buffer.lookup_transform(self.world, header.frame_id, Time.from_msg(header.stamp))
        except tf.TransformException as error:
            accepted = f"{self.world!r}, or a frame that tf connects to it: {error}"
            raise FrameError("header.frame_id", header.frame_id, accepted) from None
        return pose_of_transform(found.transform)


def _imported_tf() -> Any:
    try:
        return importlib.import_module("tf2_ros")
    except ImportError:
        return None


def handle_predict_push(registry: ModelRegistry, request: Any, response: Any) -> None:
    """Fill the response to PredictPush. Raises RequestError or PredictionError."""
    asked, residual = push_from_request(request), residual_from_request(request)
    tabulated = registry.get(request.model)
    push = with_own_window(tabulated.model, asked)
    check_request(tabulated.model, push)
    arrays = push.arrays
    prediction = tabulated.predict_rows(*arrays)
    _check_finite(tabulated, prediction, 0)
    if residual is not None:
        prediction = _given_residual(tabulated.model, push, prediction, residual)
    fill_response(response, prediction)
    if not response.in_domain:
        response.message = domain_remark(tabulated.model, Push(*arrays), prediction.in_domain)


def handle_predict_push_batch(
    check_cancelled: Callable[[], None], registry: ModelRegistry, request: Any, response: Any
) -> None:
    """Fill the response to PredictPushBatch; one bad push refuses the whole batch.

    check_cancelled: called before each chunk. Raises RequestError or PredictionError.
    """
    if (count := len(request.velocity)) > MAX_PUSHES:
        raise TooLargeError("velocity length", count, f"at most {MAX_PUSHES} pushes a call")
    asked = query_from_batch_request(request)
    tabulated = registry.get(asked.model)
    query, inside = replace(asked, duration=own_window(tabulated.model, asked.duration)), [np.ones(0, dtype=np.bool_)]
    check_requests(tabulated.model, query.inputs, query.duration, query.covariates)
    _check_exact(tabulated, query)
    for start in range(0, count, CHUNK):
        check_cancelled()
        rows = slice(start, start + CHUNK)
        inputs, covariates = query.inputs[rows], {name: column[rows] for name, column in query.covariates.items()}
        prediction = tabulated.predict_rows(inputs, np.full(len(inputs), query.duration), covariates)
        _check_finite(tabulated, prediction, start)
        extend_batch_response(response, prediction)
        inside.append(prediction.in_domain)
    pushes = Push(query.inputs, np.full(count, query.duration), query.covariates)
    response.message = domain_remark(tabulated.model, pushes, np.concatenate(inside))
    response.success = True


def handle_predict_slider_pose(frames: RequestFrames, registry: ModelRegistry, request: Any, response: Any) -> None:
    """Fill the response to PredictSliderPose, in the frame of the request. Raises RequestError."""
    tabulated, frame = registry.get(request.model), frames.pose_in_world(request.header)
    slider, duration = world_slider("slider", request.slider, frame), own_window(tabulated.model, request.duration)
    after = slider_after(tabulated, world_push(request, slider, frame, duration))
    fill_slider_response(response, request.header, frame, slider, duration, after)


def handle_rollout_pushes(
    check_cancelled: Callable[[], None], frames: RequestFrames, registry: ModelRegistry, request: Any, response: Any
) -> None:
    """Fill the response to RolloutPushes, in the frame of the request.

    At least PARTICLES particles are used, so that the poses do not depend on the number of samples requested.
    check_cancelled: called before each window. Raises RequestError.
    """
    steps, covariates = steps_from_request(request)
    tabulated, frame = registry.get(request.model), frames.pose_in_world(request.header)
    steps[steps[:, 3] == 0.0, 3] = own_window(tabulated.model, 0.0)
    slider, covariance = world_start(request, frame)
    rolled = rollout(
        tabulated,
        slider.planar,
        covariance,
        steps,
        max(PARTICLES, request.particles),
        request.seed,
        covariates=covariates,
        check_cancelled=check_cancelled,
    )
    fill_rollout_response(response, frame, slider, rolled, request.particles)


def handle_suggest_pushes(
    check_cancelled: Callable[[], None], registry: ModelRegistry, request: Any, response: Any
) -> None:
    """Fill the result of SuggestPushes. check_cancelled: called before each push. Raises RequestError."""
    suggested = suggest_pushes(
        registry.get(request.model).model,
        request.count,
        limits_from_request(request),
        covariates=covariates_of_push(request),
        seed=request.seed,
        check_cancelled=check_cancelled,
    )
    fill_suggest_response(response, suggested)


def handle_list_models(registry: ModelRegistry, request: Any, response: Any) -> None:
    """Fill the response to ListModels."""
    names, default = registry.names, registry.default
    response.names, response.default_model = names, default
    response.descriptions = [registry.describe(name) for name in names]
    response.models = [
        model_to_info(name, registry.file(name), registry.get(name).model, name == default) for name in names
    ]
    response.success = True


def handle_load_model(registry: ModelRegistry, request: Any, response: Any) -> None:
    """Load the file and fill the response to LoadModel. Raises ModelFileError or RequestError; nothing changes then."""
    if not request.path:
        raise RequestError("path", request.path, "the path of a model file on the server's machine")
    response.name = registry.load(Path(request.path), request.name)
    how = registry.get(response.name).how
    response.success, response.message = True, f"{request.path} is loaded as {response.name!r}; {how}"


def _given_residual(model: PushModel, push: PushRequest, prediction: Prediction, residual: Array) -> Prediction:
    """The prediction for the next window of a push, given the residuals (k, 3) of the windows before, oldest first.

    These windows are taken to follow one another, with the same prediction, speed and duration.
    """
    k = len(residual)
    same = Prediction(
        prediction.mean.repeat(k, axis=0),
        prediction.covariance.repeat(k, axis=0),
        prediction.process_covariance.repeat(k, axis=0),
        prediction.in_domain.repeat(k),
    )
    distance = push.velocity * push.duration * np.arange(k, 0, -1, dtype=np.float64)
    return given_earlier(prediction, EarlierWindows(same, same.mean + residual, distance), persistence_of(model))


def _check_exact(tabulated: TabulatedModel, query: PushQuery) -> None:
    """Raise TooLargeError if too many pushes need the model itself, not its table."""
    if len(query.inputs) > MAX_EXACT and (count := tabulated.exact_count(query.inputs)) > MAX_EXACT:
        accepted = f"at most {MAX_EXACT} pushes a call without a table (docs/reference/predict_server.md)"
        raise TooLargeError("velocity length", f"{count} pushes without a table", accepted)


def _check_finite(tabulated: TabulatedModel, prediction: Prediction, start: int) -> None:
    """Raise PredictionError for the first push without a finite prediction; start: index of the chunk's first push."""
    if (bad := prediction.first_not_finite) is not None:
        raise PredictionError(f"push {start + bad}: {tabulated.model.name} has no finite prediction: {NOT_FINITE}")
