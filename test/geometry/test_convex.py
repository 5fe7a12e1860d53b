# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Convex polygons: depths of points, gaps between polygons, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from push_predictor.errors import RequestError
from push_predictor.geometry.convex import ConvexPolygon
from push_predictor.geometry.frames import to_world

SQUARE = ConvexPolygon(0.05 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))
TRIANGLE = ConvexPolygon(np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 0.3]]))


def test_depth_is_the_distance_to_the_nearest_edge_line():
    points = np.array([[[0.1, 0.05], [0.05, 0.1]], [[0.1, -0.02], [0.4, 0.3]]])
    np.testing.assert_allclose(TRIANGLE.depth(points), [[0.05, 0.05], [-0.02, -0.24]])


@pytest.mark.parametrize(("pose", "gap"), [
    ((0.4 + 0.15, 0.0, 0.0), 0.1 * 0.6),  # beside the sharp corner: along the normal of the long edge
    ((0.2, -0.08, 0.0), 0.03),
    ((0.2, -0.08, np.pi / 4.0), 0.08 - 0.05 * np.sqrt(2.0)),
    ((0.2, -0.04, 0.0), -0.01),
    ((-0.07, 0.1, np.pi / 2.0), 0.02),
])  # fmt: skip
def test_gap_is_the_distance_where_an_edge_is_nearest(pose, gap):
    expected = max(gap, 0.1) if pose[0] == pytest.approx(0.55) else gap
    assert TRIANGLE.gap(SQUARE, np.array([pose]))[0] == pytest.approx(expected)


def test_gap_of_two_corners_is_less_than_their_distance():
    gap = SQUARE.gap(SQUARE, np.array([[0.13, 0.14, 0.0]]))[0]
    assert gap == pytest.approx(0.04) and gap < np.hypot(0.03, 0.04)


def test_gap_is_positive_exactly_where_the_polygons_are_apart():
    poses = np.random.default_rng(0).uniform([-0.1, -0.1, -3.0], [0.45, 0.4, 3.0], (60, 3))
    gaps = TRIANGLE.gap(SQUARE, poses)
    assert 10 < np.count_nonzero(gaps > 0.0) < 50
    for pose, gap in zip(poses, gaps, strict=True):
        corners = np.vstack([np.column_stack([to_world(SQUARE.vertices, pose), np.ones(4), np.zeros(4)]),
                             np.column_stack([-TRIANGLE.vertices, np.zeros(3), np.ones(3)])])  # fmt: skip
        common_point = linprog(np.zeros(7), A_eq=corners.T, b_eq=[0.0, 0.0, 1.0, 1.0])
        assert (common_point.status == 0) == (gap <= 0.0)


@pytest.mark.parametrize(("vertices", "accepted"), [
    ([[0.0, 0.0], [1.0, 0.0]], "at least three"),
    ([0.0, 1.0, 2.0], "at least three"),
    ([[0.0, 0.0], [1.0, np.nan], [0.0, 1.0]], "finite"),
    ([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]], "counter-clockwise"),
    ([[0.0, 0.0], [1.0, 0.0], [0.3, 0.3], [0.0, 1.0]], "convex"),
    ([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 1.0]], "convex"),
    ([[np.cos(a), np.sin(a)] for a in 0.8 * np.pi * np.arange(5)], "convex"),  # a pentagram turns twice
])  # fmt: skip
def test_polygon_that_is_not_convex_is_refused(vertices, accepted):
    with pytest.raises(RequestError, match=accepted) as error:
        ConvexPolygon(np.array(vertices))
    assert error.value.field == "polygon"
