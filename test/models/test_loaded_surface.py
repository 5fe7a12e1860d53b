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

"""A limit surface under direction-dependent friction and a pull: large effects, not first order ones."""

from __future__ import annotations

import numpy as np
import pytest
from forward_pushes import SQUARE
from push_predictor.models.mechanics.limit_surfaces.direction_dependence import root_of
from push_predictor.models.mechanics.limit_surfaces.load_map import load_map
from push_predictor.models.mechanics.limit_surfaces.loaded_surface import LoadedSurface
from push_predictor.models.mechanics.limit_surfaces.point_friction import load_of_twist
from push_predictor.models.mechanics.limit_surfaces.support_surfaces import row_surfaces
from supports import THREE_POINTS

from push_predictor.models.mechanics.pressure import patch
from push_predictor.types import Array


@pytest.mark.parametrize("stretch", [(0.3, 0.0), (0.75, 0.0), (-0.2, 0.4)])
@pytest.mark.parametrize("kind", ["patch", "three"])
def test_stretched_surface_is_near_the_sum_of_direction_dependent_point_frictions(
    kind: str, stretch: tuple[float, float]
) -> None:
    """A point at velocity u resists with W^-1 u / sqrt(u' W^-1 u)."""
    support = patch(SQUARE) if kind == "patch" else THREE_POINTS
    surface, points = load_map(support), support.points - support.centre
    a, b = stretch
    inverse = np.linalg.inv(np.array([[1.0 + a, b], [b, 1.0 - a]]))
    draw = np.random.default_rng(0).standard_normal((300, 3)) / [1.0, 1.0, surface.length]
    u = draw[:, None, :2] + draw[:, None, 2:] * np.column_stack([-points[:, 1], points[:, 0]])
    resisted = u @ inverse
    f = support.shares[:, None] * resisted / np.sqrt(np.sum(u * resisted, axis=2))[:, :, None]
    moment = np.sum(points[:, 0] * f[:, :, 1] - points[:, 1] * f[:, :, 0], axis=1) / surface.length
    rows, zero = np.arange(300), np.zeros(300, dtype=np.int64)
    surfaces = row_surfaces([surface], zero, zero, np.zeros(300))
    loaded = LoadedSurface(surfaces, rows, root_of(np.tile(stretch, (300, 1)), surfaces.of_rows.reach))
    found = np.stack(loaded.twist(slice(None), *f.sum(axis=1).T, moment), axis=1)
    wanted = draw * [1.0, 1.0, surface.length]
    plain = np.stack(surface.twist(*f.sum(axis=1).T, moment), axis=1)
    share = {"patch": 0.12, "three": 0.5}[kind]  # three points keep the shape of their surface
    assert np.mean(_angle(found, wanted)) < share * np.mean(_angle(plain, wanted))


def test_pull_lies_with_the_pushers_load_on_the_limit_surface() -> None:
    surface, n, draw = load_map(THREE_POINTS), 200, np.random.default_rng(1)
    pull = draw.uniform(-0.3, 0.3, (n, 3))
    rows, zero = np.arange(n), np.zeros(n, dtype=np.int64)
    loaded = LoadedSurface(row_surfaces([surface], zero, zero, np.zeros(n)), rows, pull=pull)
    pusher = draw.standard_normal((n, 3))
    factor, load = loaded.on_surface(slice(None), tuple(pusher.T))
    on_surface = np.stack(load, axis=1) / np.linalg.norm(pusher, axis=1)[:, None]
    assert surface.gauge(*on_surface.T) == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(surface.gauge(*on_surface.T) - 1.0)) < 1e-3
    assert on_surface - pull == pytest.approx(factor[:, None] * pusher, abs=1e-9)


def _angle(one: Array, other: Array) -> Array:
    one, other = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (one, other))
    return np.asarray(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=1), 0.0, 1.0)))


def test_load_of_twist_agrees_with_stretch_of_zero() -> None:
    surface, zero = load_map(THREE_POINTS), np.zeros(5, dtype=np.int64)
    surfaces = row_surfaces([surface], zero, zero, np.zeros(5))
    loaded = LoadedSurface(surfaces, np.arange(5), root_of(np.zeros((5, 2)), surfaces.of_rows.reach))
    load = load_of_twist(THREE_POINTS, np.random.default_rng(0).standard_normal((5, 3)))
    assert np.stack(loaded.twist(slice(None), *load.T)) == pytest.approx(np.stack(surface.twist(*load.T)))
