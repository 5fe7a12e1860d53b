# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Outlines: contacts, normals, nearest points and symmetry agree with the shapes' own geometry."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.special import ellipe

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import (
    SHAPES,
    ellipse,
    has_mirror_symmetry,
    mirror_image,
    rectangle,
    shape_outline,
    square,
    transformed,
)
from push_predictor.types import Array

TRIANGLE = Outline(np.array([[-0.05, -0.05], [0.1, -0.05], [-0.05, 0.1]]))
ELL = Outline(np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.04], [0.04, 0.04], [0.04, 0.1], [0.0, 0.1]]))
MOVED = transformed(ellipse(0.0785, 0.0525), 0.4, (0.01, -0.02))
OUTLINES = {name: shape_outline(name) for name in SHAPES} | {"triangle": TRIANGLE, "ell": ELL, "moved": MOVED}
EVERY_OUTLINE = pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)

some_outline = st.sampled_from(list(OUTLINES.values()))
contacts = st.floats(0.0, 1.0, exclude_max=True)
GRID = (np.arange(400) + 0.37) / 400


@EVERY_OUTLINE
def test_contacts_are_counter_clockwise_and_proportional_to_arc_length(outline):
    fine = np.arange(4000) / 4000
    points = outline.point(fine)
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    expected = outline.perimeter / 4000
    assert np.quantile(np.abs(steps - expected), 0.99) < 2e-4 * expected  # all but the steps across a corner
    assert np.sum(steps) == pytest.approx(outline.perimeter, rel=1e-3)
    assert points[0] == pytest.approx(outline.vertices[0], abs=1e-9)
    area = 0.5 * np.sum(points[:, 0] * np.roll(points[:, 1], -1) - np.roll(points[:, 0], -1) * points[:, 1])
    assert area == pytest.approx(outline.area, rel=1e-3)


@EVERY_OUTLINE
def test_pickle_does_not_depend_on_what_was_computed_before(outline):
    """Cached results of other functions are found by it."""
    fresh = Outline(outline.vertices, outline.semi_axes, outline.pose)
    before = pickle.dumps(fresh)
    assert fresh.perimeter > 0.0 and fresh.area > 0.0 and len(fresh.project(np.zeros((1, 2))).distance) == 1
    assert pickle.dumps(fresh) == before
    copy = pickle.loads(before)
    np.testing.assert_array_equal(copy.vertices, outline.vertices)
    assert (copy.semi_axes, copy.pose) == (outline.semi_axes, outline.pose)


@pytest.mark.parametrize(("a", "b"), [(0.0525, 0.0525), (0.0785, 0.0525), (0.03, 0.06)])
def test_perimeter_and_area_of_an_ellipse_equal_those_of_the_curve(a, b):
    outline, large, small = ellipse(a, b), max(a, b), min(a, b)
    assert outline.perimeter == pytest.approx(4.0 * large * ellipe(1.0 - (small / large) ** 2), rel=1e-6)
    assert outline.area == pytest.approx(np.pi * a * b)


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
@pytest.mark.parametrize("offset", [-0.002, 0.0, 0.003])
def test_point_off_the_outline_projects_back_to_its_contact(outline, offset):
    near_corner = np.min(np.abs(GRID[:, None] - outline.edge_starts[None]), axis=1) * outline.perimeter < 0.006
    contact = GRID if outline.semi_axes is not None else GRID[~near_corner]
    foot = outline.point(contact)
    found = outline.project(foot - offset * outline.inward_normal(contact))
    assert found.contact == pytest.approx(contact, abs=2e-7)
    assert found.point == pytest.approx(foot, abs=1e-9)
    assert found.distance == pytest.approx(offset, abs=1e-9)
    assert found.normal == pytest.approx(-outline.inward_normal(contact), abs=1e-6)


@st.composite
def polygons(draw: st.DrawFn) -> Outline:
    """Stars about the origin of 3 to 9 corners, most of them not convex, somewhere in the plane."""
    count = draw(st.integers(3, 9))
    radius = np.array(draw(st.lists(st.floats(0.01, 0.1), min_size=count, max_size=count)))
    turn = 2.0 * np.pi * np.arange(count) / count + draw(st.floats(-3.0, 3.0))
    return Outline(radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)]) + draw(st.floats(-0.1, 0.1)))


def winds_around(outline: Outline, point: Array) -> bool:
    """Whether the outline goes around a point, by the sum of the angles of its edges."""
    x, y = (outline.vertices - point).T
    turned = np.arctan2(x * np.roll(y, -1) - np.roll(x, -1) * y, x * np.roll(x, -1) + y * np.roll(y, -1))
    return bool(abs(turned.sum()) > np.pi)


@given(polygons(), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_projection_on_any_polygon_is_the_nearest_point_of_all_edges(outline: Outline, x: float, y: float) -> None:
    point, ends = np.array([x, y]), np.roll(outline.vertices, -1, axis=0)
    found = outline.project(point[None])
    fine = np.linspace(0.0, 1.0, 2001)[:, None]
    nearest = min(
        float(np.min(np.linalg.norm(a + fine * (b - a) - point, axis=1)))
        for a, b in zip(outline.vertices, ends, strict=True)
    )
    longest = float(np.max(np.linalg.norm(ends - outline.vertices, axis=1)))
    assert nearest - longest / 4000 - 1e-12 <= abs(found.distance[0]) <= nearest + 1e-12
    assert np.linalg.norm(found.point[0] - point) == pytest.approx(abs(found.distance[0]), abs=1e-14)
    assert np.linalg.norm(found.normal[0]) == pytest.approx(1.0)
    if nearest > 1e-9:
        assert (found.distance[0] < 0.0) == winds_around(outline, point)
    if found.distance[0] > 1e-9:
        assert found.point + found.distance[:, None] * found.normal == pytest.approx(point[None], abs=1e-12)
    assert outline.point(found.contact) == pytest.approx(found.point, abs=1e-9)


@given(
    st.floats(0.01, 0.1), st.floats(0.01, 0.1), st.tuples(*[st.floats(-0.1, 0.1)] * 2, st.floats(-3.0, 3.0)),
    st.floats(-0.2, 0.2), st.floats(-0.2, 0.2),
)  # fmt: skip
@example(0.0785, 0.0525, (0.0, 0.0, 0.0), 0.0, 0.0)
@example(0.0525, 0.0525, (0.0, 0.0, 0.0), 0.0, 0.0)
@example(0.1, 0.02, (0.0, 0.0, 0.0), 0.05, 0.0)
@example(0.1, 0.02, (0.0, 0.0, 0.0), 0.05, 1e-7)
@example(0.03, 0.06, (0.0, 0.0, 0.0), 0.0, -0.05)
def test_projection_on_an_ellipse_with_a_pose_is_its_nearest_point(
    a: float, b: float, pose: tuple[float, float, float], x: float, y: float
) -> None:
    outline, point = transformed(ellipse(a, b), pose[2], pose[:2]), np.array([x, y])
    found = outline.project(point[None])
    turn = np.linspace(0.0, 2.0 * np.pi, 20001)
    curve = rotate(np.column_stack([a * np.cos(turn), b * np.sin(turn)]), np.array(pose[2])) + pose[:2]
    nearest = float(np.min(np.linalg.norm(curve - point, axis=1)))
    u, v = rotate(point - pose[:2], np.array(-pose[2]))
    assert abs(found.distance[0]) == pytest.approx(nearest, abs=max(a, b) * np.pi / 20000)
    assert abs(found.distance[0]) <= nearest + 1e-12
    assert found.point + found.distance[:, None] * found.normal == pytest.approx(point[None], abs=1e-12)
    if abs(found.distance[0]) > 1e-9:
        assert (found.distance[0] < 0.0) == ((u / a) ** 2 + (v / b) ** 2 < 1.0)


@EVERY_OUTLINE
def test_points_level_with_a_corner_to_rounding_are_on_the_right_side(outline: Outline) -> None:
    """A ray from such a point runs through the corner."""
    for y in outline.vertices[:, 1]:
        level = np.array([0.0, 1e-300, -6e-26, 1e-17, -1e-17]) + y
        middle = np.column_stack([np.zeros(5), level])
        expected = [winds_around(outline, point) for point in middle]
        clear = np.abs(outline.project(middle).distance) > 1e-9
        assert np.array_equal((outline.project(middle).distance < 0.0)[clear], np.array(expected)[clear])
        assert np.all(outline.project(np.column_stack([np.full(5, -0.3), level])).distance > 0.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@EVERY_OUTLINE
def test_a_point_that_is_not_finite_has_no_nearest_one(outline: Outline, bad: float) -> None:
    found = outline.project(np.array([[0.1, 0.0], [bad, 0.01], [0.1, 0.0]]))
    assert not np.isfinite(found.distance[1])
    assert np.isfinite(found.distance[[0, 2]]).all() and np.array_equal(found.point[0], found.point[2])


def test_normal_at_a_corner_turns_from_one_edge_to_the_next():
    outline, corner = square(0.09), np.array([-0.045, -0.045])
    angles = np.linspace(np.pi, 1.5 * np.pi, 9)[1:-1]
    found = outline.project(corner + 0.005 * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    assert np.all(found.at_vertex)
    assert found.point == pytest.approx(np.tile(corner, (7, 1)))
    assert np.unwrap(np.arctan2(found.normal[:, 1], found.normal[:, 0])) % (2 * np.pi) == pytest.approx(angles)
    assert found.distance == pytest.approx(0.005)


ROUNDED = Outline(np.array([[0.016, -0.062], [0.095, -0.079], [-0.01, -0.021]]))  # its last corner lies 3e-17 m outside


@pytest.mark.parametrize("outline", [square(0.09), shape_outline("hex"), ROUNDED], ids=["square", "hex", "rounded"])
def test_a_corner_itself_is_on_the_outline_with_the_normal_of_one_of_its_edges(outline):
    found, normals = outline.project(outline.vertices), -outline.inward_normal(outline.edge_starts[:-1] + 1e-3)
    assert found.point == pytest.approx(outline.vertices)
    assert found.distance == pytest.approx(0.0, abs=1e-15)
    for normal, before, after in zip(found.normal, np.roll(normals, 1, axis=0), normals, strict=True):
        assert min(np.linalg.norm(normal - before), np.linalg.norm(normal - after)) < 1e-9


@given(some_outline, contacts)
def test_contact_is_recovered_from_edge_and_fraction(outline, contact):
    edge, fraction = outline.edge(np.array([contact]))
    assert 0.0 <= fraction[0] <= 1.0
    assert outline.contact_on_edge(int(edge[0]), float(fraction[0])) == pytest.approx(contact, abs=1e-12)


@EVERY_OUTLINE
def test_end_of_an_edge_belongs_to_that_edge(outline):
    for edge in range(len(outline.edge_starts) - 1):
        contact = outline.contact_on_edge(edge, 1.0)
        assert outline.edge(np.array([contact]))[0][0] == edge
        assert contact < 1.0


@pytest.mark.parametrize(
    ("outline", "order"),
    [
        *zip(OUTLINES.values(), (4, 0, 2, 2, 6, 1, 1, 1), strict=True),
        (rectangle(0.12, 0.06), 2),
        (transformed(square(0.09), shift=(0.01, 0.01)), 1),
        (transformed(shape_outline("ellip2"), 0.4), 2),
        (transformed(shape_outline("ellip1"), 0.4), 0),
        (transformed(shape_outline("ellip1"), 0.0, (0.001, 0.0)), 1),
    ],
)
def test_rotational_symmetry(outline, order):
    assert outline.rotational_symmetry == order


@pytest.mark.parametrize("name", SHAPES)
def test_origin_of_the_shapes_is_their_centroid(name):
    assert shape_outline(name).centroid == pytest.approx([0.0, 0.0], abs=1e-15)


def test_centroid_moves_with_the_outline():
    assert TRIANGLE.centroid == pytest.approx([0.0, 0.0], abs=1e-15)
    assert Outline(TRIANGLE.vertices + [0.3, -0.2]).centroid == pytest.approx([0.3, -0.2])
    parts = np.array([[0.05, 0.02], [0.02, 0.07]]), np.array([0.1 * 0.04, 0.04 * 0.06])
    assert ELL.centroid == pytest.approx(np.average(parts[0], axis=0, weights=parts[1]))


def test_first_edge_of_the_square_faces_the_negative_x_axis():
    outline = shape_outline("rect1")
    assert outline.inward_normal(np.array([0.125]))[0] == pytest.approx([1.0, 0.0])
    assert outline.point(np.array([0.125]))[0] == pytest.approx([-0.045, 0.0])


@pytest.mark.parametrize(
    ("vertices", "message"),
    [
        ([[0.0, 0.0], [1.0, 0.0]], "at least three"),
        ([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]], "clockwise"),
        ([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], "enclose nothing"),
        ([[0.0, 0.0], [1.0, np.nan], [0.0, 1.0]], "not finite"),
    ],
)
def test_invalid_outline_is_rejected(vertices, message):
    with pytest.raises(RigError, match=message):
        Outline(np.array(vertices))


def test_unknown_shape_is_rejected_by_name():
    with pytest.raises(RigError, match="heptagon"):
        shape_outline("heptagon")


# --- moved and mirrored ----------------------------------------------------------------------------------------------


@EVERY_OUTLINE
def test_a_transformed_outline_contains_the_scaled_turned_and_shifted_points(outline):
    moved, centre = transformed(outline, 0.3, (0.02, -0.01), 1.1), outline.centroid
    expected = centre + [0.02, -0.01] + rotate(1.1 * (outline.point(GRID) - centre), np.array(0.3))
    assert moved.point(GRID) == pytest.approx(expected, abs=1e-8)
    assert moved.centroid == pytest.approx(centre + [0.02, -0.01], abs=1e-12)
    assert moved.inward_normal(GRID) == pytest.approx(rotate(outline.inward_normal(GRID), np.array(0.3)), abs=1e-6)
    assert moved.polar_moment == pytest.approx(1.21 * outline.polar_moment)


@EVERY_OUTLINE
def test_a_mirror_image_has_its_points_at_the_negative_y(outline):
    image = mirror_image(outline)
    assert image.point(-GRID % 1.0) == pytest.approx(outline.point(GRID) * [1.0, -1.0], abs=1e-8)
    assert image.area == pytest.approx(outline.area)


def test_mirror_symmetry_is_that_of_any_axis():
    assert all(has_mirror_symmetry(OUTLINES[name]) for name in (*SHAPES, "triangle", "ell", "moved"))
    assert has_mirror_symmetry(transformed(TRIANGLE, 0.3, (0.1, 0.0)))
    assert not has_mirror_symmetry(Outline(TRIANGLE.vertices * [1.0, 0.8]))
    parallelogram = Outline(np.array([[0.0, 0.0], [0.1, 0.0], [0.13, 0.05], [0.03, 0.05]]))
    assert not has_mirror_symmetry(parallelogram)


@pytest.mark.parametrize("error", [0.0, 1e-17, 1e-16, -1e-16, 1e-12, -1e-12])
def test_a_corner_belongs_to_the_edge_that_faces_the_point_whatever_the_rounding(error: float) -> None:
    """From the other edge's normal a push onto the corner would have an angle of a quarter turn."""
    square = shape_outline("rect1")
    for k, corner in enumerate(square.vertices):
        normal = square.inward_normal(np.array([(k + 0.5) / 4.0]))[0]
        points = corner - 0.005 * normal + error * np.array([[1.0, 0.0], [0.0, 1.0]])
        contact = square.project(points).contact
        assert np.all(square.edge(contact)[0] == k)
        np.testing.assert_allclose(square.point(contact), [corner, corner], atol=1e-11)
