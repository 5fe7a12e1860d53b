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

"""Features of a push that a kernel can compare, from velocity, contact and angle.

The outline's rotational symmetry is folded (docs/reference/push.md): a square's four sides are one. Mirror symmetry
is not assumed. On a smooth outline the contact is a point on a closed curve, so it enters by its cosine and sine.
"""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.types import Array

EDGE_SPACING = 3.0  # distance, in edge lengths, between edges that no symmetry maps onto each other


def push_features(outline: Outline, inputs: Array) -> Array:
    """Features (n, D) of inputs (n, 3: velocity m/s, contact, angle rad); the velocity comes first, the angle last."""
    velocity, contact, angle = inputs.T
    places = _contact_features(outline, contact)
    features = np.empty((len(inputs), 2 + len(places)))  # np.column_stack takes several times as long
    features[:, 0], features[:, -1] = velocity, angle
    for k, place in enumerate(places, 1):
        features[:, k] = place
    return features


def _contact_features(outline: Outline, contact: Array) -> list[Array]:
    order = outline.rotational_symmetry
    if order == 0:
        return []
    if outline.semi_axes is not None:
        phase = 2.0 * np.pi * order * contact
        return [np.cos(phase), np.sin(phase)]
    edge, fraction = outline.edge(contact)
    return [EDGE_SPACING * (edge % (len(outline.vertices) // order)) + fraction]
