# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Features of a push that a kernel can compare, from velocity, contact and angle.

The outline's rotational symmetry is folded (docs/reference/push.md): a square's four sides are one. Mirror symmetry
is not assumed. On a smooth outline the contact is a point on a closed curve, so it enters by its cosine and sine.
"""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.boundary import place_features
from push_predictor.geometry.outline import Outline
from push_predictor.types import Array

EDGE_SPACING = 3.0  # distance, in edge lengths, between edges that no symmetry maps onto each other


def push_features(outline: Outline, inputs: Array) -> Array:
    """Features (n, D) of inputs (n, 3: velocity m/s, contact, angle rad); the velocity comes first, the angle last."""
    order = outline.rotational_symmetry
    places = 0 if order == 0 else 1 if outline.semi_axes is None else 2
    features = np.empty((len(inputs), 2 + places))
    place_features(np.array(inputs, dtype=np.float64, order="C"), outline.boundary, order, EDGE_SPACING, features)
    return features
