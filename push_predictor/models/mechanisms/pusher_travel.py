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

"""A pusher that travels less than commanded: it yields to the load, or slows down within the window."""

from __future__ import annotations

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.mechanism import Mechanism, Parameter, Push
from push_predictor.types import Array

STEP = 0.02  # of the path length


def response(physics: AnalyticalPush, push: Push) -> Array:
    """Outcome per unit of the relative change of the pusher's path length, (n, 3, 1)."""
    duration = np.concatenate([share * push.duration for share in (1.0 + STEP, 1.0 - STEP)])
    more, less = np.split(physics.displacement(np.tile(push.inputs, (2, 1)), duration), 2)
    return np.asarray(((more - less) / (2.0 * STEP))[:, :, None])


PUSHER_TRAVEL = Mechanism(
    "pusher_travel",
    (Parameter("relative change of the pusher's path length", "1", 0.5),),
    response,
    quantities=("travel_share",),
)
