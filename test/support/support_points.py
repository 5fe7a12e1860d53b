# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

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
