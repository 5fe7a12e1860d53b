# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service predict_slider_pose: from poses in a request's frame to the slider's pose after the push."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from msg_adapters.slider_poses import fill_slider_response, query_from_slider_request, world_push
from push_predictor.models.request import own_window
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.nodes.server.request_frames import RequestFrames
from push_predictor.planning.slider_pose import slider_after


def handle_predict_slider_pose(frames: RequestFrames, registry: ModelRegistry, request: Any, response: Any) -> None:
    """Fill the response to PredictSliderPose, in the frame of the request. Raises RequestError."""
    asked = query_from_slider_request(request)
    tabulated = registry.get(asked.model)
    query = replace(asked, duration=own_window(tabulated.model, asked.duration))
    frame = frames.pose_in_world(request.header)
    push = world_push(query, frame)
    fill_slider_response(response, request.header, query, frame, push, slider_after(tabulated, push))
