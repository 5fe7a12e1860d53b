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

"""A pushed slider moves as Coulomb friction allows: sticking inside the cone, sliding on its edges, never pulled."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from push_predictor.models.mechanics.limit_surface import contact_force
from push_predictor.models.mechanics.limit_surfaces.load_map import LoadMap, load_map
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.models.mechanics.motion.contact_solution import Driven, Touch, TwistOf, driven, driven_on_ellipsoid
from supports import FOUR_POINTS, THREE_POINTS

from push_predictor.geometry.shapes import square
from push_predictor.models.mechanics.pressure import patch
from push_predictor.types import Array

SUPPORTS = {"square": patch(square(0.09)), "three points": THREE_POINTS, "four points": FOUR_POINTS}
N = 200
seeds = st.integers(0, 10**6)
EVERY_SURFACE = pytest.mark.parametrize("name", ["ellipsoid", *SUPPORTS])


@cache
def surface_of(name: str) -> LoadMap | PowerSurface:
    return load_map(SUPPORTS[name]) if name in SUPPORTS else PowerSurface(np.zeros(2), 0.03)


def twist_of(name: str) -> TwistOf:
    """One surface for all contacts."""
    return lambda rows, x, y, moment: surface_of(name).twist(x, y, moment)


def touches(seed: int, n: int = N) -> Touch:
    """Random contacts, up to two lengths off the centre, and pushers that approach."""
    draw = np.random.default_rng(seed)
    turn, angle = draw.uniform(-np.pi, np.pi, n), draw.uniform(-1.5, 1.5, n)
    p, q = draw.uniform(-2.0, 2.0, (2, n))
    return Touch(np.cos(turn), np.sin(turn), p, q, np.cos(angle), np.sin(angle))


def cones(seed: int, n: int = N) -> tuple[Array, Array]:
    left, right = np.arctan(np.random.default_rng([seed, 1]).uniform(0.0, 1.5, (2, n)))
    return left, right


def contact_velocity(touch: Touch, motion: Driven) -> tuple[Array, Array]:
    """Of the body at the contact, along the normal and along its left."""
    toward = motion.vx * touch.normal_x + motion.vy * touch.normal_y + motion.spin * touch.normal_arm
    return toward, motion.vy * touch.normal_x - motion.vx * touch.normal_y + motion.spin * touch.left_arm


@EVERY_SURFACE
@settings(max_examples=8, deadline=None)
@given(seed=seeds)
def test_contact_velocity_obeys_coulomb_friction(name: str, seed: int) -> None:
    touch, (left, right) = touches(seed), cones(seed)
    motion = driven(twist_of(name), touch, left, right)
    toward, sideways = contact_velocity(touch, motion)
    moving = np.abs(motion.vx) + np.abs(motion.vy) + np.abs(motion.spin) > 0.0
    assert np.all(moving)
    assert toward == pytest.approx(touch.along, abs=1e-9)  # neither separation nor penetration
    sticks, lag = motion.slip == 0, touch.across - sideways
    size = np.hypot(toward, sideways)
    assert np.max(np.abs(lag[sticks]) / size[sticks], initial=0.0) < 2e-3
    assert np.all(lag * motion.slip >= 0.0)  # the pusher slips to the side that is stated
    assert np.all(motion.force_angle <= left + 1e-9)
    assert np.all(motion.force_angle >= -right - 1e-9)
    assert motion.force_angle[motion.slip > 0] == pytest.approx(left[motion.slip > 0])
    assert motion.force_angle[motion.slip < 0] == pytest.approx(-right[motion.slip < 0])


@EVERY_SURFACE
def test_pushing_dissipates_energy(name: str) -> None:
    touch, (left, right) = touches(1), cones(1)
    motion = driven(twist_of(name), touch, left, right)
    toward, sideways = contact_velocity(touch, motion)
    assert np.all(np.cos(motion.force_angle) * toward + np.sin(motion.force_angle) * sideways > 0.0)
    assert set(motion.slip.tolist()) == {-1, 0, 1}


def test_ellipsoid_gives_the_closed_form() -> None:
    touch, friction = touches(3), 0.4
    p, q, edge = touch.normal_arm, touch.left_arm, np.full(N, np.arctan(friction))
    motion = driven(twist_of("ellipsoid"), touch, edge, edge)
    push, rub, slip = contact_force(1.0 + p * p, p * q, 1.0 + q * q, touch.along, touch.across, friction)
    assert motion.vx == pytest.approx(push * touch.normal_x - rub * touch.normal_y, abs=1e-12)
    assert motion.vy == pytest.approx(push * touch.normal_y + rub * touch.normal_x, abs=1e-12)
    assert motion.spin == pytest.approx(push * p + rub * q, abs=1e-12)
    assert motion.slip.tolist() == slip.tolist()
    closed = driven_on_ellipsoid(touch, np.full(N, friction))
    assert np.stack(closed) == pytest.approx(np.stack(motion), abs=1e-12)


@EVERY_SURFACE
def test_receding_pusher_leaves_slider_at_rest(name: str) -> None:
    touch, (left, right) = touches(4), cones(4)
    motion = driven(twist_of(name), touch._replace(along=-touch.along), left, right)
    assert not np.any([motion.vx, motion.vy, motion.spin, motion.slip])


@EVERY_SURFACE
def test_slip_begins_where_the_force_reaches_the_edge_of_the_cone(name: str) -> None:
    """The pusher's angle at which a sticking force lies on the edge divides sticking from sliding."""
    touch = touches(5)
    wide, edge = np.full(N, np.arctan(1.5)), np.full(N, np.arctan(0.3))
    free = driven(twist_of(name), touch, wide, wide)
    narrow = driven(twist_of(name), touch, edge, edge)
    outside = np.abs(free.force_angle) > edge + 1e-3
    inside = np.abs(free.force_angle) < edge - 1e-3
    assert np.all(narrow.slip[outside & (free.slip == 0)] == np.sign(free.force_angle[outside & (free.slip == 0)]))
    assert np.all(narrow.slip[inside] == 0)
    assert narrow.vx[inside] == pytest.approx(free.vx[inside], abs=2e-3)


@EVERY_SURFACE
def test_without_friction_the_force_is_along_the_normal(name: str) -> None:
    touch, zero = touches(6), np.zeros(N)
    motion = driven(twist_of(name), touch, zero, zero)
    assert motion.force_angle == pytest.approx(0.0, abs=1e-12)
    twist = surface_of(name).twist(touch.normal_x, touch.normal_y, touch.normal_arm)
    cross = np.cross(np.stack(twist, axis=1), np.stack([motion.vx, motion.vy, motion.spin], axis=1))
    assert cross == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", ["ellipsoid", "square"])
def test_mirrored_touch_gives_the_mirrored_motion_of_a_symmetric_surface(name: str) -> None:
    touch, (left, right) = touches(7), cones(7)
    mirrored = Touch(touch.normal_x, -touch.normal_y, -touch.normal_arm, touch.left_arm, touch.along, -touch.across)
    here = driven(twist_of(name), touch, left, right)
    there = driven(twist_of(name), mirrored, right, left)
    assert there.vx == pytest.approx(here.vx, abs=1e-2)
    assert there.vy == pytest.approx(-here.vy, abs=1e-2)
    assert there.spin == pytest.approx(-here.spin, abs=1e-2)
