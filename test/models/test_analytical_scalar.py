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

"""Single pushes of the analytical model in plain numbers equal those computed as arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from push_predictor.geometry.nearest import nearest_on
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.analytical_scalar import scalar_analytical
from push_predictor.models.mechanics.limit_surface import Support
from push_predictor.models.mechanics.motion.sweep import LONGEST_STEP
from push_predictor.models.mechanics.scalar.mechanics import FEW
from synthetic import triangle

from push_predictor.errors import RequestError
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline, transformed
from push_predictor.models.mechanisms import LIBRARY, Push
from push_predictor.types import Array

MOVED = transformed(shape_outline("ellip3"), 0.4, (0.01, -0.02))
NOTCHED = Outline(np.array([[-0.04, -0.03], [0.04, -0.03], [0.04, 0.03], [0.0, 0.005], [-0.04, 0.03]]))
OUTLINES = {
    "square": shape_outline("rect1"),
    "hexagon": shape_outline("hex"),
    "ellipse": shape_outline("ellip3"),
    "circle": shape_outline("ellip1"),
    "triangle": triangle(),
}
SUPPORT = Support((0.004, -0.003), 0.03)


def spread_pushes(n: int, seed: int = 0) -> tuple[Array, Array]:
    """Short and long pushes; in some of them the pusher slides off."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(0.0, 0.2, n), rng.random(n), rng.uniform(-1.5, 1.5, n)])
    return inputs, rng.uniform(0.01, 0.5, n)


@pytest.mark.parametrize("shape", [*OUTLINES, "notched", "moved"])
@given(place=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)))
@settings(max_examples=60, deadline=None)
def test_the_nearest_point_is_that_of_the_outline(shape: str, place: tuple[float, float]) -> None:
    outline = {**OUTLINES, "notched": NOTCHED, "moved": MOVED}[shape]
    *point, nx, ny, distance = nearest_on(outline)(*place)  # of two that are equally near it may be either
    assert distance == pytest.approx(float(outline.project(np.array([place])).distance[0]), abs=1e-14)
    np.testing.assert_allclose(outline.project(np.array([point])).distance, 0.0, atol=1e-14)
    assert np.hypot(*(np.array(place) - point)) == pytest.approx(abs(distance), abs=1e-14)
    if distance > 0.0 or shape != "notched":  # the inside of a notch's corner has no normal of its own
        np.testing.assert_allclose(np.array(point) + distance * np.array([nx, ny]), place, atol=1e-14)
    assert np.hypot(nx, ny) == pytest.approx(1.0)


def test_points_level_with_corners_are_classified_correctly() -> None:
    nearest = nearest_on(OUTLINES["square"])
    height = float(OUTLINES["square"].vertices[:, 1].max())
    for x, y, inside in ((0.0, 0.0, True), (-0.2, height, False), (0.2, -height, False), (-0.2, 0.0, False)):
        assert (nearest(x, y)[4] < 0.0) == inside


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.00475, 0.0])
@pytest.mark.parametrize("shape", OUTLINES)
def test_single_push_equals_the_same_push_in_a_batch(shape: str, radius: float) -> None:
    physics = AnalyticalPush(OUTLINES[shape], radius, 0.3, SUPPORT)
    inputs, duration = spread_pushes(60)
    assert np.max(inputs[:, 0] * duration) > 10.0 * LONGEST_STEP
    alone = scalar_analytical(physics)
    rows = [alone.displacement(inputs[k : k + 1], duration[k : k + 1]) for k in range(len(inputs))]
    np.testing.assert_allclose(np.concatenate(rows), physics.displacement(inputs, duration), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("count", [0, 2, FEW, FEW + 1])
def test_few_pushes_equal_many_pushes(count: int) -> None:
    physics = AnalyticalPush(OUTLINES["hexagon"], 0.005, 0.4)
    inputs, duration = spread_pushes(count)
    ours = scalar_analytical(physics).displacement(inputs, duration)
    assert ours.shape == (count, 3)
    np.testing.assert_allclose(ours, physics.displacement(inputs, duration), rtol=1e-9, atol=1e-12)


def test_replaced_physics_keeps_prepared_outline() -> None:
    physics = AnalyticalPush(OUTLINES["square"], 0.005)
    inputs, duration = spread_pushes(1, seed=3)
    for change in ({"contact_friction": 0.1}, {"pusher_radius": 0.01}, {"support": SUPPORT}):
        ours, theirs = replace(scalar_analytical(physics), **change), replace(physics, **change)
        np.testing.assert_allclose(
            ours.displacement(inputs, duration), theirs.displacement(inputs, duration), rtol=1e-9, atol=1e-12
        )


@pytest.mark.parametrize("count", [3, FEW + 1])
def test_several_models_equal_those_of_array_mechanics(count: int) -> None:
    physics, (inputs, duration) = AnalyticalPush(OUTLINES["square"], 0.005), spread_pushes(count, seed=3)
    changes = [{"contact_friction": 0.1}, {"support": SUPPORT}]
    ours, theirs = (
        model.displacements([replace(model, **change) for change in changes], inputs, duration)
        for model in (scalar_analytical(physics), physics)
    )
    np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda m: m.name)
def test_responses_equal_those_of_array_mechanics(mechanism) -> None:
    physics = AnalyticalPush(OUTLINES["square"], 0.00475)
    inputs, duration = spread_pushes(5, seed=1)
    push = Push(inputs, duration, {"slider_heading": np.linspace(-3.0, 3.0, 5)})
    ours, theirs = mechanism.response(scalar_analytical(physics), push), mechanism.response(physics, push)
    np.testing.assert_allclose(ours, theirs, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("push", [(np.nan, 0.1, 0.1), (-0.1, 0.1, 0.1), (0.02, np.inf, 0.1), (0.02, 0.1, np.nan)])
def test_rejects_invalid_push_by_name(push: tuple[float, float, float]) -> None:
    with pytest.raises(RequestError, match="is not accepted, give a finite number"):
        scalar_analytical(AnalyticalPush(OUTLINES["square"], 0.005)).displacement(np.array([push]), np.array([0.2]))
