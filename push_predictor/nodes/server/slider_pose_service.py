# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
