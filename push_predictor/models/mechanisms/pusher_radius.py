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

"""A tip thicker or thinner than the rig file states: worn, bent, with a sleeve. It rolls on the side by its radius."""

from __future__ import annotations

from dataclasses import replace

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.types import Array

STEP = 0.001  # m


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per metre of radius, the contact point being the same, (n, 3, 1)."""
    low, high = max(physics.pusher_radius - STEP, 0.0), physics.pusher_radius + STEP
    more, less = (replace(physics, pusher_radius=r).displacement(push.inputs, push.duration) for r in (high, low))
    return ((more - less) / (high - low))[:, :, None]


PUSHER_RADIUS = Mechanism(
    "pusher_radius", (Parameter("change of the pusher's radius", "m", 0.004),), response, quantities=("radius_error",)
)
