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

"""Single pushes of fitted mechanics in plain numbers equal those computed as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest
from push_predictor.geometry.nearest import contact_on
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.models.mechanics.motion.contact_solution import RESTS
from push_predictor.models.mechanics.scalar.contact import (
    LastContact,
    driven_on_ellipsoid,
    driven_scalar,
)
from push_predictor.models.mechanics.scalar.mechanics import FEW, scalar_mechanics
from supports import FOUR_POINTS, THREE_POINTS

from push_predictor.geometry.shapes import shape_outline, transformed
from push_predictor.models.mechanics.fitted import NO_CHANGES, FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS
from push_predictor.types import Array

SQUARE = shape_outline("rect1")
SUPPORTS = {
    "patch": PushMechanics(SQUARE, 0.00475),
    "three": PushMechanics(SQUARE, 0.00475, THREE_POINTS),
    "ellipse": PushMechanics(shape_outline("ellip3"), 0.00475),
    "power": PushMechanics(SQUARE, 0.00475, PowerSurface(np.array([0.002, 0.0]), 0.03, 2.5)),
    "ellipsoid": PushMechanics(SQUARE, 0.0, PowerSurface(np.zeros(2), 0.03)),
    "recordings": PushMechanics(SQUARE, 0.00475, None, {1: THREE_POINTS, 2: FOUR_POINTS}),
}
IN_METRES = np.array([1.0, 1.0, 0.034])


def pushes(n: int, seed: int = 0) -> tuple[Array, Array, dict[str, Array]]:
    """Short and long pushes at all angles; some slide off."""
    draw = np.random.default_rng(seed)
    inputs = np.column_stack([draw.uniform(0.0, 0.1, n), draw.random(n), draw.uniform(-1.4, 1.4, n)])
    covariates = {"push_heading": draw.uniform(-3.0, 3.0, n), "recording": draw.integers(0, 3, n).astype(float)}
    return inputs, draw.uniform(0.01, 0.4, n), covariates


def one_by_one(fitted: FittedMechanics, inputs: Array, duration: Array, covariates: dict[str, Array]) -> Array:
    rows = [slice(k, k + 1) for k in range(len(inputs))]
    return np.concatenate([
        fitted.displacement(inputs[k], duration[k], {name: column[k] for name, column in covariates.items()})
        for k in rows
    ])  # fmt: skip


def assert_same(fitted: FittedMechanics, n: int = 12, seed: int = 0) -> None:
    given = pushes(n, seed)
    alone, together = one_by_one(scalar_mechanics(fitted), *given), fitted.displacement(*given)
    assert alone * IN_METRES == pytest.approx(together * IN_METRES, rel=2e-5, abs=2e-7)


def computed_as_arrays(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of pushes of the calls that were computed as arrays."""
    calls: list[int] = []
    plain = FittedMechanics.displacement

    def counted(
        self: FittedMechanics,
        inputs: Array,
        duration: Array,
        covariates: Mapping[str, Array] | None = None,
        changes: Mapping[str, Array] = NO_CHANGES,
    ) -> Array:
        calls.append(len(inputs))
        return plain(self, inputs, duration, covariates, changes)

    monkeypatch.setattr(FittedMechanics, "displacement", counted)
    return calls


@pytest.mark.parametrize("name", SUPPORTS)
def test_single_push_equals_the_same_push_in_a_batch(name: str) -> None:
    assert_same(FittedMechanics(SUPPORTS[name], {"contact_friction": 0.25}))


EACH = {p.name: 0.3 * p.high for p in PARAMETERS if p.name not in ("inertia", "rim_exponent")}


@cache
def under_each_parameter() -> dict[str, Array]:
    """Displacements (n, 3) of the same pushes as arrays, under each parameter alone; all rows at once."""
    inputs, duration, covariates = pushes(6, 1)
    rows = np.tile(np.arange(6), len(EACH))
    own = np.repeat(np.arange(len(EACH)), 6)
    values = {name: np.where(own == k, value, BY_NAME[name].textbook) for k, (name, value) in enumerate(EACH.items())}
    given = inputs[rows], duration[rows], {name: column[rows] for name, column in covariates.items()}
    return dict(zip(EACH, np.split(SUPPORTS["three"].displacement(values, *given), len(EACH)), strict=True))


@pytest.mark.parametrize("name", EACH)
def test_every_parameter_has_the_same_effect(name: str) -> None:
    alone = one_by_one(scalar_mechanics(FittedMechanics(SUPPORTS["three"], {name: EACH[name]})), *pushes(6, 1))
    assert alone * IN_METRES == pytest.approx(under_each_parameter()[name] * IN_METRES, rel=2e-5, abs=2e-7)


@pytest.mark.parametrize("exponent", [-0.3, 0.5, 0.8])
def test_rim_exponent_has_the_same_effect(exponent: float) -> None:
    assert_same(FittedMechanics(SUPPORTS["patch"], {"rim_exponent": exponent}), seed=2)


@pytest.mark.parametrize(("name", "most"), [("rim_exponent", 0.8), ("pressure_spread", 0.3)])
def test_changes_of_the_pressure_count_push_by_push(name: str, most: float) -> None:
    fitted, (inputs, duration, covariates) = FittedMechanics(SUPPORTS["patch"], {"contact_friction": 0.25}), pushes(8)
    changes = {name: np.linspace(0.0, most, 8)}
    together = fitted.displacement(inputs, duration, covariates, changes)
    alone = scalar_mechanics(fitted).displacement(inputs, duration, covariates, changes)
    assert alone * IN_METRES == pytest.approx(together * IN_METRES, rel=2e-5, abs=2e-7)
    unchanged = fitted.displacement(inputs, duration, covariates)
    assert np.abs((alone - unchanged) * IN_METRES)[-1].max() > 1e-5


def test_all_parameters_together_have_the_same_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    values = {p.name: p.textbook + p.spread for p in PARAMETERS if p.name != "inertia"}
    assert_same(FittedMechanics(SUPPORTS["ellipse"], values), n=6, seed=3)
    calls, given = computed_as_arrays(monkeypatch), pushes(3)
    scalar_mechanics(FittedMechanics(SUPPORTS["ellipse"], values)).displacement(*given)
    assert not calls


def test_strong_friction_that_depends_on_direction_has_the_same_effect() -> None:
    values = {"body_anisotropy": 0.7, "grain_diagonal": -0.6, "slope_x": 0.4, "pushing_height": 0.01}
    assert_same(FittedMechanics(SUPPORTS["patch"], values), seed=4)


@pytest.mark.parametrize("count", [0, 2, FEW, FEW + 1])
def test_few_pushes_equal_many_pushes(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    fitted, given = FittedMechanics(SUPPORTS["three"], {"contact_friction": 0.2}), pushes(count)
    expected = fitted.displacement(*given)
    calls = computed_as_arrays(monkeypatch)
    found = scalar_mechanics(fitted).displacement(*given)
    assert found * IN_METRES == pytest.approx(expected * IN_METRES, rel=2e-5, abs=2e-7)
    assert found.shape == (count, 3)
    assert calls == ([count] if count in (0, FEW + 1) else [])


def test_inertia_is_computed_as_arrays(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted, given = FittedMechanics(SUPPORTS["three"], {"inertia": 0.3}), pushes(2)
    calls = computed_as_arrays(monkeypatch)
    assert np.array_equal(scalar_mechanics(fitted).displacement(*given), fitted.displacement(*given))
    assert calls == [2, 2]


def test_demands_the_covariate_that_a_parameter_needs() -> None:
    inputs, duration, _ = pushes(1)
    with pytest.raises(KeyError, match="push_heading"):
        scalar_mechanics(FittedMechanics(SUPPORTS["three"], {"slope_x": 0.1})).displacement(inputs, duration)


def test_no_travel_and_a_receding_pusher_move_nothing() -> None:
    still = scalar_mechanics(FittedMechanics(SUPPORTS["three"]))
    inputs = np.array([[0.0, 0.1, 0.2], [0.02, 0.1, 2.0]])
    assert not np.any(still.displacement(inputs, np.array([0.2, 0.2])))


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("shape", ["rect1", "hex", "ellip3", "ellip1"])
def test_point_and_normal_of_a_contact_are_those_of_the_outline(shape: str, moved: bool) -> None:
    outline = transformed(shape_outline(shape), 0.4, (0.01, -0.02)) if moved else shape_outline(shape)
    contacts = np.concatenate([np.random.default_rng(0).random(50), outline.edge_starts[:-1], [np.nextafter(1.0, 0.0)]])
    found = np.array([contact_on(outline)(c) for c in contacts.tolist()])
    expected = np.column_stack([outline.point(contacts), outline.inward_normal(contacts)])
    assert found == pytest.approx(expected, abs=1e-12)


def test_contact_on_an_ellipsoid_in_closed_form_is_that_found_by_iteration():
    """Contacts that stick, slip to either side, and leave."""
    draw, reached = np.random.default_rng(5), set()
    for _ in range(400):
        turn, normal_arm, left_arm, along, across = draw.uniform(-4.0, 4.0, 5)
        left, right = draw.uniform(0.0, 2.0, 2)
        touch = (np.cos(turn), np.sin(turn), normal_arm, left_arm, along, across)
        closed = driven_on_ellipsoid(touch, left, right)
        assert closed == pytest.approx(driven_scalar(lambda *load: load, touch, left, right, LastContact(), 1e-13))
        vx, vy, spin, slip = closed
        sideways = vy * touch[0] - vx * touch[1] + spin * left_arm
        slipped = 0 if abs(sideways - across) < 1e-9 else int(np.sign(across - sideways))
        assert slip == (slipped if along > 0.0 else RESTS)
        reached.add(slip if along > 0.0 else "leaving")
    assert reached == {"leaving", -1, 0, 1}
