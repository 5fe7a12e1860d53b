"""From a slider and a sequence of pushes to poses with covariance: what rollout_pushes does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msg_adapters.rollouts import fill_rollout_response, query_from_rollout_request, world_slider
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.nodes.server.request_frames import RequestFrames
from push_predictor.planning.rollout import PARTICLES, rollout


def answer_rollout(
    go_on: Callable[[], None], frames: RequestFrames, shelf: ModelRegistry, request: Any, response: Any
) -> None:
    """Answer RolloutPushes, in the frame of the request. go_on is called now and then and may raise.

    PARTICLES are carried along, so that the poses do not depend on how many samples are wanted; more where more are.
    Raises RequestError.
    """
    query = query_from_rollout_request(request)
    tabulated = shelf.get(query.model)
    frame = frames.located(request.header)
    slider = world_slider(query, frame)
    particles = max(PARTICLES, query.samples)
    rolled = rollout(
        tabulated, slider.planar, slider.covariance, query.steps, particles, query.seed, check_cancelled=go_on
    )
    fill_rollout_response(response, frame, slider, rolled, query.samples)
