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

"""The pressure of a slider that stands on points, from the loads that were measured."""

from __future__ import annotations

import numpy as np

from push_predictor.models.mechanics.surface import PowerSurface
from push_predictor.types import Array


def support_of_points(points: Array) -> PowerSurface:
    """The ellipsoid of a slider on points (k, 3: x, y in m in the body frame, load share), shares scaled to sum to 1.

    Its centre is the load-weighted mean, its length the load-weighted mean distance from it.
    """
    places, load = points[:, :2], points[:, 2]
    centre = np.average(places, axis=0, weights=load)
    length = np.average(np.linalg.norm(places - centre, axis=1), weights=load)
    return PowerSurface(centre, float(length))
