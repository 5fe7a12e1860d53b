"""From poses in a request's frame to the slider's pose after the push: what predict_slider_pose does."""

from __future__ import annotations

from typing import Any

from msg_adapters.slider_poses import fill_slider_response, query_from_slider_request, world_push
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.nodes.server.request_frames import RequestFrames
from push_predictor.planning.slider_pose import slider_after


def answer_slider_pose(frames: RequestFrames, shelf: ModelRegistry, request: Any, response: Any) -> None:
    """Answer PredictSliderPose, in the frame of the request. Raises RequestError."""
    query = query_from_slider_request(request)
    tabulated = shelf.get(query.model)
    frame = frames.located(request.header)
    push = world_push(query, frame)
    fill_slider_response(response, request.header, query, frame, push, slider_after(tabulated, push))
