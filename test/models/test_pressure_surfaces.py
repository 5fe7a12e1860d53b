# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Limit surfaces of pressure distributions obey their definition: the sum of the frictions of their points."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from supports import FOUR_POINTS, THREE_POINTS, TWO_POINTS

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import SHAPES, ellipse, shape_outline, square, transformed
from push_predictor.models.mechanics.load_map import (
    AZIMUTHS,
    DIRECTIONS,
    ELEVATIONS,
    LoadMap,
    load_map,
    power_of_twist,
    reach,
    twist_of_load,
)
from push_predictor.models.mechanics.pressure import PressureDistribution, patch, supported_at
from push_predictor.models.mechanics.surface import uniform_ellipsoid
from push_predictor.types import Array

RADIUS = 0.05  # m, of a disc
NOTCHED = Outline(np.array([[-0.04, -0.03], [0.04, -0.03], [0.04, 0.03], [0.0, -0.005], [-0.04, 0.03]]))
SUPPORTS = {
    "square": patch(square(0.09)),
    "disc": patch(ellipse(RADIUS, RADIUS)),
    "rim": patch(square(0.09), 8.0),
    "three points": THREE_POINTS,
    "four points": FOUR_POINTS,
}
EVERY_SUPPORT = pytest.mark.parametrize("name", SUPPORTS)
twists = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)).filter(
    lambda t: np.linalg.norm(t) > 0.1
)


@cache
def map_of(name: str) -> LoadMap:
    return load_map(SUPPORTS[name])


def about_centre(support: PressureDistribution) -> PressureDistribution:
    return PressureDistribution(support.points - support.centre, support.shares, support.spread)


def angle_between(one: Array, other: Array) -> Array:
    one, other = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (one, other))
    return np.asarray(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=1), 0.0, 1.0)))


def loads() -> Array:
    """The loads (n, 3: moment over length) at the nodes of a table, but for those of the last column."""
    rise = np.linspace(0.0, 0.5 * np.pi, ELEVATIONS)
    turn = np.arange(AZIMUTHS) * 2.0 * np.pi / AZIMUTHS
    up, around = (grid.ravel() for grid in np.meshgrid(rise, turn, indexing="ij"))
    return np.column_stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])


def nodes(surface: LoadMap) -> tuple[Array, Array]:
    """Unit twists (n, 3: spin times length) of these loads, and their sizes (n,) on the surface."""
    rows = surface.nodes[:, :-1].reshape(-1, 4)
    return rows[:, :3], rows[:, 3]


def resisted(support: PressureDistribution, twist: Array) -> Array:
    """Loads (n, 3) of twists (n, 3): the sum of the frictions of the points, each spread over its area."""
    x, y = support.points.T
    u = np.stack([twist[:, :1] - twist[:, 2:] * y, twist[:, 1:2] + twist[:, 2:] * x], axis=2)
    area = 2.0 * max(support.spread, 3e-3 * support.length) ** 2
    weight = support.shares / np.sqrt(np.sum(u * u, axis=2) + area * twist[:, 2:] ** 2)
    force = weight[:, :, None] * u
    moment = np.sum(x * force[:, :, 1] - y * force[:, :, 0] + weight * area * twist[:, 2:], axis=1)
    return np.column_stack([force.sum(axis=1), moment])


# --- the definition -------------------------------------------------------------------------------------------------


@given(twists)
def test_load_is_the_slope_of_the_power_and_drives_the_twist_that_it_resists(twist: tuple[float, float, float]) -> None:
    given_ = np.array([[twist[0], twist[1], twist[2] / 0.04]])
    load = resisted(THREE_POINTS, given_)
    steps = 1e-6 * np.diag([1.0, 1.0, 25.0])
    slope = (power_of_twist(THREE_POINTS, given_ + steps) - power_of_twist(THREE_POINTS, given_ - steps)) / (
        2.0 * np.diag(steps)
    )
    assert load[0] * [1.0, 1.0, 25.0] == pytest.approx(slope * [1.0, 1.0, 25.0], abs=1e-4)
    assert load[0] @ given_[0] == pytest.approx(power_of_twist(THREE_POINTS, given_)[0], rel=1e-9)
    back = resisted(THREE_POINTS, twist_of_load(THREE_POINTS, load))
    assert back == pytest.approx(load, abs=1e-6)


@EVERY_SUPPORT
def test_a_tables_twists_have_the_loads_of_its_nodes(name: str) -> None:
    support, surface, wanted = about_centre(SUPPORTS[name]), map_of(name), loads()
    twist, size = nodes(surface)
    assert np.linalg.norm(twist, axis=1) == pytest.approx(1.0, abs=2e-3)
    back = resisted(support, twist / [1.0, 1.0, surface.quantities[2]]) / [1.0, 1.0, surface.quantities[2]]
    error = angle_between(back, wanted)
    assert np.mean(error) < (1e-4 if "points" in name else 0.002) and np.quantile(error, 0.99) < 0.02
    assert size == pytest.approx(np.linalg.norm(back, axis=1), rel=0.01)
    assert np.all(np.sum(twist * wanted, axis=1) > 0.0)  # friction dissipates


def test_slopes_of_a_patch_change_its_table_as_its_stretched_arms_do() -> None:
    """And few points have none: the flats of their surface move."""
    assert not map_of("three points").slopes.any()
    arms, a = about_centre(SUPPORTS["square"]), 0.4
    more, less = (
        load_map(PressureDistribution(arms.points * np.sqrt([1.0 + side, 1.0 - side]), arms.shares, arms.spread)).nodes
        for side in (a, -a)
    )
    secant = (more - less) / (2.0 * a)
    assert np.linalg.norm(map_of("square").slopes[:, :, :4] - secant) < 0.1 * np.linalg.norm(secant)


# --- flats ----------------------------------------------------------------------------------------------------------


def test_two_points_of_support_slide_along_and_turn() -> None:
    twist, _ = nodes(load_map(TWO_POINTS))
    along, turned = np.array([np.cos(0.25 * np.pi), np.sin(0.25 * np.pi), 0.0]), np.array([0.0, 0.0, 1.0])
    for load in (along, turned):
        at = np.argmin(np.linalg.norm(loads() - load, axis=1))
        assert angle_between(twist[at : at + 1], load[None])[0] < 0.01


# --- distributions --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_even_patch_has_the_centre_and_length_of_the_closed_form(name: str) -> None:
    outline = shape_outline(name)
    exact, sampled = uniform_ellipsoid(outline), patch(outline)
    assert sampled.centre == pytest.approx(exact.centre, abs=2e-4)
    assert sampled.length == pytest.approx(exact.length, rel=5e-3)


def test_patch_of_an_outline_with_hidden_parts_stays_inside_it() -> None:
    sampled, exact = patch(NOTCHED), uniform_ellipsoid(NOTCHED)
    assert np.all(NOTCHED.project(sampled.points).distance < 0.0)
    assert sampled.centre == pytest.approx(exact.centre, abs=1e-3)
    assert sampled.length == pytest.approx(exact.length, rel=0.03)


@pytest.mark.parametrize("outline", [square(0.09), NOTCHED], ids=["square", "notched"])
def test_pressure_at_the_rim_reaches_further(outline: Outline) -> None:
    lengths = [patch(outline, e).length for e in (-4.0, -1.0, 0.0, 1.0, 4.0, 12.0)]
    assert np.all(np.diff(lengths) > 0.0)


def test_pressure_of_a_disc_follows_its_exponent() -> None:
    """With pressure in proportion to rho^e the mean distance is (e + 2) / (e + 3) of the radius."""
    for e in (0.0, 1.0, 4.0):
        assert patch(ellipse(RADIUS, RADIUS), e).length == pytest.approx(RADIUS * (e + 2.0) / (e + 3.0), rel=1e-6)
    assert patch(ellipse(RADIUS, RADIUS), -1.0).length == pytest.approx(RADIUS / 2.0, rel=1e-6)


def test_quantities_are_those_of_the_points() -> None:
    about = about_centre(THREE_POINTS)
    x, y = about.points.T
    squares = about.shares @ (x * x), about.shares @ (x * y), about.shares @ (y * y)
    expected = [*THREE_POINTS.centre, THREE_POINTS.length, *squares]
    assert map_of("three points").quantities == pytest.approx([*expected, *reach(about)])
    assert map_of("square").quantities[3:6] == pytest.approx([0.09**2 / 12.0, 0.0, 0.09**2 / 12.0], rel=0.01, abs=1e-7)


def test_reach_is_shared_by_direction() -> None:
    assert reach(about_centre(SUPPORTS["square"])).sum() == pytest.approx(1.0)
    line = reach(PressureDistribution(np.array([[0.0, -0.02], [0.0, 0.02]]), np.array([0.5, 0.5])))
    assert np.flatnonzero(line).tolist() == [DIRECTIONS // 2]
    turn = 0.25 * np.pi / DIRECTIONS  # a quarter of the way from the first direction to the second
    arm = np.array([np.cos(turn), np.sin(turn)])
    between = reach(PressureDistribution(np.stack([arm, -arm]), np.array([0.5, 0.5])))
    assert between[:3] == pytest.approx([0.75, 0.25, 0.0])


# --- the ellipsoid of even pressure ----------------------------------------------------------------------------------


ELL = Outline(np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.04], [0.04, 0.04], [0.04, 0.1], [0.0, 0.1]]))


def test_even_pressure_has_the_known_mean_distance_of_circle_and_square() -> None:
    assert uniform_ellipsoid(ellipse(0.0525, 0.0525)).length == pytest.approx(2.0 / 3.0 * 0.0525, rel=1e-15)
    expected = 0.09 * (np.sqrt(2.0) + np.log(1.0 + np.sqrt(2.0))) / 6.0
    assert uniform_ellipsoid(square(0.09)).length == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("outline", [*map(shape_outline, SHAPES), ELL, NOTCHED], ids=[*SHAPES, "ell", "notched"])
def test_even_pressure_equals_the_sum_over_a_grid(outline: Outline) -> None:
    ticks = np.linspace(-0.10975, 0.10975, 440) + 1.3e-5  # off the edges
    points = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    inside = points[outline.project(points).distance < 0.0]
    found = uniform_ellipsoid(outline)
    assert found.centre == pytest.approx(np.mean(inside, axis=0), abs=2e-4)
    assert found.length == pytest.approx(np.mean(np.linalg.norm(inside - found.centre, axis=1)), rel=2e-3)


def test_the_pressure_of_a_moved_ellipse_moves_with_it() -> None:
    own, pose = ellipse(0.0785, 0.0525), (0.01, -0.02, 0.4)
    moved = transformed(own, pose[2], pose[:2])
    found = uniform_ellipsoid(moved)
    assert found.centre == pytest.approx(pose[:2])
    assert found.length == pytest.approx(uniform_ellipsoid(own).length)
    expected = rotate(patch(own).points, np.array(pose[2])) + pose[:2]
    assert patch(moved).points == pytest.approx(expected, abs=1e-15)


# --- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "match"),
    [
        ([[0.0, 0.0, 1.0]], "fewer than two"),
        ([[0.0, 0.0, 1.0], [0.01, 0.0, 0.0]], "fewer than two"),
        ([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]], "fewer than two"),
        ([[0.0, 0.0, 1.0], [0.01, 0.0, -1.0]], "load shares >= 0"),
        ([[0.0, np.nan, 1.0], [0.01, 0.0, 1.0]], "finite"),
    ],
)
def test_rejects_support_that_cannot_bear_a_slider(points: list[list[float]], match: str) -> None:
    with pytest.raises(RigError, match=match):
        supported_at(np.array(points))


def test_rejects_points_and_shares_of_different_numbers() -> None:
    with pytest.raises(RigError, match="shapes"):
        PressureDistribution(np.zeros((3, 2)), np.ones(2))
