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

"""The nearest point of a single point: that of Outline, also where edges or corners are equally near."""

from __future__ import annotations

import numpy as np
import pytest
from push_predictor.geometry.nearest import nearest_on
from synthetic import triangle

from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline

HOLLOW = Outline(np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.05, 0.02], [0.0, 0.1]]))
STRAIGHT = Outline(np.array([[0.0, 0.0], [0.05, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]]))  # with a vertex on an edge
OUTLINES = {
    "square": shape_outline("rect1"),
    "hexagon": shape_outline("hex"),
    "triangle": triangle(),
    "hollow": HOLLOW,
    "straight": STRAIGHT,
}


def by_brute_force(outline: Outline, x: float, y: float) -> float:
    """Distance to the nearest of 4000 points on each edge."""
    ends = np.roll(outline.vertices, -1, axis=0)
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    return min(
        float(np.linalg.norm(a + share * (b - a) - [x, y], axis=1).min())
        for a, b in zip(outline.vertices, ends, strict=True)
    )


@pytest.mark.parametrize("shape", OUTLINES)
def test_point_normal_and_distance(shape: str) -> None:
    """Inside, next to edges, and next to corners, of convex and of other polygons."""
    outline = OUTLINES[shape]
    nearest, draw = nearest_on(outline), np.random.default_rng(0)
    corners = 0
    for x, y in draw.uniform(-0.15, 0.15, (150, 2)).tolist():
        at_x, at_y, nx, ny, distance = nearest(x, y)
        assert abs(distance) == pytest.approx(by_brute_force(outline, x, y), abs=2e-5)
        assert (at_x + distance * nx, at_y + distance * ny) == pytest.approx((x, y), abs=1e-12)
        assert nx * nx + ny * ny == pytest.approx(1.0)
        assert (distance < 0.0) == inside(outline, x, y)
        corners += any(np.hypot(at_x - a, at_y - b) < 1e-12 for a, b in outline.vertices)
    assert corners > 10


def inside(outline: Outline, x: float, y: float) -> bool:
    """By the winding number."""
    towards = outline.vertices - [x, y]
    turns = np.diff(np.unwrap(np.append(np.arctan2(*towards.T[::-1]), np.arctan2(*towards[0][::-1]))))
    return abs(float(turns.sum())) > np.pi


def test_normal_of_an_edge_up_to_its_corner() -> None:
    nearest = nearest_on(shape_outline("rect1"))
    assert nearest(0.0449, 0.0449 - 0.001)[2:4] == pytest.approx((1.0, 0.0))
    assert nearest(0.05, 0.0449)[2:4] == pytest.approx((1.0, 0.0))
    assert nearest(0.05, 0.05)[2:4] == pytest.approx((np.sqrt(0.5), np.sqrt(0.5)))
