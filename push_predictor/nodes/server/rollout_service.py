# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service rollout_pushes: from a slider and a sequence of pushes to poses with covariance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msg_adapters.rollouts import fill_rollout_response, query_from_rollout_request, world_slider
from push_predictor.models.request import own_window
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.nodes.server.request_frames import RequestFrames
from push_predictor.planning.rollout import PARTICLES, rollout


def handle_rollout_pushes(
    check_cancelled: Callable[[], None], frames: RequestFrames, registry: ModelRegistry, request: Any, response: Any
) -> None:
    """Fill the response to RolloutPushes, in the frame of the request.

    At least PARTICLES particles are used, so that the poses do not depend on the number of samples requested.
    check_cancelled: called before each window; it raises when the node ends. Raises RequestError.
    """
    query = query_from_rollout_request(request)
    tabulated = registry.get(query.model)
    steps = query.steps.copy()
    steps[steps[:, 3] == 0.0, 3] = own_window(tabulated.model, 0.0)
    frame = frames.pose_in_world(request.header)
    slider = world_slider(query, frame)
    particles = max(PARTICLES, query.samples)
    rolled = rollout(
        tabulated,
        slider.planar,
        slider.covariance,
        steps,
        particles,
        query.seed,
        covariates=query.covariates,
        check_cancelled=check_cancelled,
    )
    fill_rollout_response(response, frame, slider, rolled, query.samples)
