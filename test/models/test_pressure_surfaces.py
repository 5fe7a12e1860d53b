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

"""Limit surfaces of pressure distributions obey their definition: the sum of the frictions of their points."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from push_predictor.models.mechanics.limit_surface import uniform_support
from push_predictor.models.mechanics.limit_surfaces.load_map import LoadMap, load_map
from push_predictor.models.mechanics.limit_surfaces.point_friction import load_of_twist, twist_of_load
from push_predictor.models.mechanics.limit_surfaces.support_surfaces import row_surfaces
from push_predictor.models.mechanics.limit_surfaces.surfaces import DIRECTIONS, PowerSurface, spread_by_direction
from supports import FOUR_POINTS, THREE_POINTS, TWO_POINTS

from push_predictor.errors import RigError
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import SHAPES, ellipse, shape_outline, square
from push_predictor.models.mechanics.pressure import PressureDistribution, patch, supported_at
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


def directions(n: int, seed: int = 0) -> Array:
    draw = np.random.default_rng(seed).standard_normal((n, 3))
    return np.asarray(draw / np.linalg.norm(draw, axis=1, keepdims=True))


def angle_between(one: Array, other: Array) -> Array:
    one, other = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (one, other))
    return np.asarray(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=1), 0.0, 1.0)))


def tabulated(surface: LoadMap | PowerSurface, load: Array) -> Array:
    """Twists (n, 3: spin times length) of loads (n, 3: moment over length)."""
    return np.stack(surface.twist(*load.T), axis=1)


# --- the definition -------------------------------------------------------------------------------------------------


@settings(max_examples=50, deadline=None)
@given(twists)
def test_load_of_a_twist_is_the_sum_of_point_frictions(twist: tuple[float, float, float]) -> None:
    vx, vy, w = twist[0], twist[1], twist[2] / 0.04
    force, moment = np.zeros(2), 0.0
    for (x, y), share in zip(THREE_POINTS.points, THREE_POINTS.shares, strict=True):
        velocity = np.array([vx - w * y, vy + w * x])
        friction = share * velocity / max(float(np.linalg.norm(velocity)), 1e-300)
        force, moment = force + friction, moment + x * friction[1] - y * friction[0]
    assert load_of_twist(THREE_POINTS, np.array([[vx, vy, w]]))[0] == pytest.approx([*force, moment], abs=1e-9)


def disc_load(distance: float) -> tuple[float, float]:
    """Force along y and moment about the centre of an even disc that turns about a point `distance` to its right.

    In polar coordinates about that point each friction is one unit across the ray, so the integral over a ray is in
    closed form (Howe and Cutkosky 1996 give the elliptic integrals of the rest).
    """
    ray = np.pi + np.linspace(-1.0, 1.0, 200001)[1:-1] * (np.pi if distance < RADIUS else np.arcsin(RADIUS / distance))
    root = np.sqrt(RADIUS**2 - (distance * np.sin(ray)) ** 2)
    far, near = -distance * np.cos(ray) + root, np.maximum(-distance * np.cos(ray) - root, 0.0)
    step, area = ray[1] - ray[0], np.pi * RADIUS**2
    force = float(np.sum(np.cos(ray) * (far**2 - near**2) / 2.0) * step / area)
    moment = float(np.sum((far**3 - near**3) / 3.0) * step / area)
    return force, moment + distance * force


@pytest.mark.parametrize("distance", [0.0, 0.1, 0.4, 0.8, 1.2, 2.0, 5.0])
def test_even_disc_has_the_load_of_the_integral_over_its_area(distance: float) -> None:
    disc, d = patch(ellipse(RADIUS, RADIUS)), distance * RADIUS
    force, moment = disc_load(d)
    load = load_of_twist(disc, np.array([[0.0, -d, 1.0]]))[0]
    assert load == pytest.approx([0.0, force, moment], abs=2e-3 * RADIUS, rel=3e-3)


@pytest.mark.parametrize("distance", [0.4, 0.8, 1.2, 2.0, 5.0])
def test_table_of_an_even_disc_inverts_the_integral_over_its_area(distance: float) -> None:
    disc = map_of("disc")
    force, moment = disc_load(distance * RADIUS)
    load = np.array([[0.0, force, moment / disc.length]])
    twist = tabulated(disc, load)
    assert angle_between(twist, np.array([[0.0, -distance * RADIUS, disc.length]]))[0] < 6e-3
    assert disc.gauge(*load.T)[0] == pytest.approx(1.0, abs=3e-3)


@EVERY_SUPPORT
def test_tabulated_twist_has_the_load_it_was_asked_for(name: str) -> None:
    support, surface = about_centre(SUPPORTS[name]), map_of(name)
    load = directions(400)
    twist = tabulated(surface, load)
    spun = PressureDistribution(support.points, support.shares, max(support.spread, 3e-3 * surface.length))
    back = load_of_twist(spun, twist / [1.0, 1.0, surface.length]) / [1.0, 1.0, surface.length]
    error = angle_between(back, load)
    assert np.mean(error) < (0.02 if "points" in name else 0.002)  # next to a flat, a twist says little of its load
    solved = twist_of_load(support, load * [1.0, 1.0, surface.length]) * [1.0, 1.0, surface.length]
    assert np.quantile(angle_between(twist, solved), 0.99) < 0.012


@EVERY_SUPPORT
def test_gauge_is_one_on_the_limit_surface(name: str) -> None:
    support, surface = about_centre(SUPPORTS[name]), map_of(name)
    twist = directions(500, 1)
    load = load_of_twist(support, twist / [1.0, 1.0, surface.length]) / [1.0, 1.0, surface.length]
    assert surface.gauge(*load.T) == pytest.approx(1.0, abs=0.01)
    assert surface.gauge(*(3.0 * load).T) == pytest.approx(3.0 * surface.gauge(*load.T))


@EVERY_SUPPORT
def test_friction_dissipates_and_opposite_loads_drive_opposite_twists(name: str) -> None:
    load = directions(500, 2)
    twist = tabulated(map_of(name), load)
    assert np.all(np.sum(twist * load, axis=1) > 0.0)
    assert tabulated(map_of(name), -load) == pytest.approx(-twist, abs=1e-9)
    assert tabulated(map_of(name), 2.0 * load) == pytest.approx(2.0 * twist, abs=1e-9)


@EVERY_SUPPORT
def test_pure_forces_and_moments_have_unit_size(name: str) -> None:
    surface, zero, one = map_of(name), np.zeros(1), np.ones(1)
    assert surface.gauge(one, zero, zero)[0] == pytest.approx(1.0, abs=1e-4)
    assert surface.gauge(zero, one, zero)[0] == pytest.approx(1.0, abs=1e-4)
    assert surface.gauge(zero, zero, one)[0] == pytest.approx(1.0, abs=5e-3)


# --- flats ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("support", [THREE_POINTS, FOUR_POINTS], ids=["three", "four"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_loads_on_a_flat_turn_the_slider_about_one_support_point(support: PressureDistribution, sign: float) -> None:
    about, surface = about_centre(support), load_map(support)
    for k, (x, y) in enumerate(about.points):
        others = np.arange(len(about.points)) != k
        rest = PressureDistribution(about.points[others], about.shares[others])
        load = load_of_twist(rest, sign * np.array([[y, -x, 1.0]]))[0] * (1.0 - about.shares[k])
        for turn in np.linspace(0.0, 2.0 * np.pi, 7):
            f = 0.7 * about.shares[k] * np.array([np.cos(turn), np.sin(turn)])
            total = load + [*f, x * f[1] - y * f[0]]
            vx, vy, spin = tabulated(surface, total[None] / [1.0, 1.0, surface.length])[0] / [1, 1, surface.length]
            at_point = np.hypot(vx - spin * y, vy + spin * x)
            assert at_point < 0.02 * np.hypot(x, y) * abs(spin)
            assert np.sign(spin) == sign


def test_two_points_of_support_slide_along_and_turn() -> None:
    surface = load_map(TWO_POINTS)
    along, turned = np.array([[np.cos(0.25 * np.pi), np.sin(0.25 * np.pi), 0.0]]), np.array([[0.0, 0.0, 1.0]])
    assert angle_between(tabulated(surface, along), along)[0] < 0.01
    assert angle_between(tabulated(surface, turned), turned)[0] < 0.01


# --- the ellipsoid --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("power", [1.5, 2.0, 3.0])
def test_power_surface_moves_along_the_gradient_of_its_gauge(power: float) -> None:
    surface, load, step = PowerSurface(np.zeros(2), 0.03, power), directions(50, 3), 1e-6
    slopes = [
        (surface.gauge(*(load + step * e).T) - surface.gauge(*(load - step * e).T)) / (2.0 * step) for e in np.eye(3)
    ]
    assert angle_between(tabulated(surface, load), np.stack(slopes, axis=1)) == pytest.approx(0.0, abs=1e-4)
    assert tabulated(surface, 2.0 * load) == pytest.approx(2.0 * tabulated(surface, load))


def test_ellipsoid_is_near_an_even_patch_and_far_from_three_points() -> None:
    load = directions(2000, 4)
    ellipsoid = tabulated(PowerSurface(np.zeros(2), 1.0), load)
    even, three = (angle_between(tabulated(map_of(name), load), ellipsoid) for name in ("square", "three points"))
    assert np.mean(even) < 0.09
    assert np.max(even) < 0.2
    assert np.mean(three) > 2.0 * np.mean(even)


# --- distributions --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_even_patch_has_the_centre_and_length_of_the_closed_form(name: str) -> None:
    outline = shape_outline(name)
    exact, sampled = uniform_support(outline), patch(outline)
    assert sampled.centre == pytest.approx(exact.centre, abs=2e-4)
    assert sampled.length == pytest.approx(exact.length, rel=5e-3)


def test_patch_of_an_outline_with_hidden_parts_stays_inside_it() -> None:
    sampled, exact = patch(NOTCHED), uniform_support(NOTCHED)
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


def test_mean_squares_and_reach_are_those_of_the_points() -> None:
    surface, about = map_of("three points"), about_centre(THREE_POINTS)
    x, y = about.points.T
    assert surface.square == pytest.approx([about.shares @ (x * x), about.shares @ (x * y), about.shares @ (y * y)])
    assert map_of("square").square == pytest.approx([0.09**2 / 12.0, 0.0, 0.09**2 / 12.0], rel=0.01, abs=1e-7)
    assert map_of("square").reach.sum() == pytest.approx(1.0)
    line = spread_by_direction(np.array([[0.0, -0.02], [0.0, 0.01]]), np.array([0.5, 0.5]))
    assert np.flatnonzero(line).tolist() == [DIRECTIONS // 2]
    turn = 0.25 * np.pi / DIRECTIONS  # a quarter of the way from the first direction to the second
    between = spread_by_direction(np.array([[np.cos(turn), np.sin(turn)]]), np.ones(1))
    assert between[:3] == pytest.approx([0.75, 0.25, 0.0])


def test_blend_of_two_tables_lies_between_them() -> None:
    low, high = map_of("square"), map_of("rim")
    share = np.array([0.0, 0.25, 1.0])
    rows = row_surfaces([low, high], np.zeros(3, dtype=np.int64), np.ones(3, dtype=np.int64), share)
    load = np.tile(directions(1, 5), (3, 1))
    here, there = tabulated(low, load), tabulated(high, load)
    expected = here + share[:, None] * (there - here)
    assert np.stack(rows.twist(np.arange(3), *load.T), axis=1) == pytest.approx(expected)
    assert np.stack(rows.twist(np.arange(2), *load[:2].T), axis=1) == pytest.approx(expected[:2])
    assert rows.of_rows.length == pytest.approx(low.length + share * (high.length - low.length))
    sizes = [surface.gauge(*load[:1].T)[0] for surface in (low, high)]
    assert rows.gauge(np.arange(3), *load.T) == pytest.approx(sizes[0] + share * (sizes[1] - sizes[0]))


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
