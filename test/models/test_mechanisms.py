# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of mechanisms and their responses; effects as changes of parameters, exact for large ones and together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from repository import REPOSITORY
from synthetic import square_rig

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import JointEffects, joint, joint_shift
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.parameters import BY_NAME as PARAMETERS_BY_NAME
from push_predictor.models.mechanics.surface import PowerSurface, uniform_ellipsoid
from push_predictor.models.mechanisms import LARGEST, LIBRARY, REFINEMENTS, Mechanism, mechanism_named
from push_predictor.models.pushes import Push
from push_predictor.types import Array

EVERY = (*LIBRARY, *REFINEMENTS)
EVERY_MECHANISM = pytest.mark.parametrize("mechanism", EVERY, ids=lambda m: m.name)
PATCHED = FittedMechanics(PushMechanics(shape_outline("rect1"), 0.00475), {"contact_friction": 0.25})
IN_METRES = np.array([1.0, 1.0, 0.04])  # a turn counts as the path of a point 4 cm from the centre


def some(n: int, seed: int = 0, duration: float = 0.2) -> Push:
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(0.02, 0.1, n), rng.random(n), rng.uniform(-1.0, 1.0, n)])
    covariates = {"slider_heading": rng.uniform(-3.0, 3.0, n), "elapsed_time": np.linspace(0.0, 1000.0, n)}
    return Push(inputs, np.full(n, duration), covariates)


def displaced(fitted: FittedMechanics, push: Push, changed: dict[str, float]) -> Array:
    """By the forward model itself, whose headings are those of the pushes."""
    normal = fitted.outline.inward_normal(push.inputs[:, 1])
    heading = push.covariates["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + push.inputs[:, 2]
    values = {**fitted.values, **changed}
    return fitted.mechanics.displacement(values, push.inputs, push.duration, {"push_heading": heading})


# --- the table -------------------------------------------------------------------------------------------------------


def test_every_quantity_is_a_parameter_that_one_mechanism_changes() -> None:
    quantities = [quantity for mechanism in EVERY for quantity in mechanism.quantities]
    assert len(quantities) == len(set(quantities)) == len(LARGEST)
    assert set(PARAMETERS_BY_NAME) - set(quantities) == {"clock_delay"}  # at one speed it is an offset of the tip
    assert [mechanism_named(mechanism.name) for mechanism in EVERY] == list(EVERY)
    with pytest.raises(KeyError):
        mechanism_named("magic")


@EVERY_MECHANISM
def test_each_parameter_has_the_unit_of_its_quantity_and_a_limit(mechanism: Mechanism) -> None:
    assert len(mechanism.parameters) == len(mechanism.quantities)
    for parameter, quantity in zip(mechanism.parameters, mechanism.quantities, strict=True):
        assert parameter.unit == PARAMETERS_BY_NAME[quantity].unit
        assert parameter.largest == LARGEST[quantity] > PARAMETERS_BY_NAME[quantity].spread


@EVERY_MECHANISM
def test_needs_the_heading_where_its_response_depends_on_it(mechanism: Mechanism) -> None:
    push = some(12)
    turned = replace(push, covariates={"slider_heading": push.covariates["slider_heading"] + 0.7})
    same = np.array_equal(mechanism.response(PATCHED, push), mechanism.response(PATCHED, turned))
    assert mechanism.needs == (() if same else ("slider_heading",))


@EVERY_MECHANISM
def test_a_response_is_the_central_difference_of_displacements(mechanism: Mechanism) -> None:
    """Over half a standard deviation of the parameter's prior to both sides, and not below zero where that is none."""
    fitted, push = PATCHED, some(12)
    response = mechanism.response(fitted, push)
    assert response.shape == (12, 3, len(mechanism.quantities))
    for k, name in enumerate(mechanism.quantities):
        step, value = 0.5 * PARAMETERS_BY_NAME[name].spread, fitted.value(name)
        low, high = value - step, value + step
        if name in ("inertia", "contact_friction"):
            low = max(low, 0.0)
        more, less = (displaced(fitted, push, {name: end}) for end in (high, low))
        expected = (more - less) / (high - low)
        assert response[:, :, k] * IN_METRES == pytest.approx(expected * IN_METRES, rel=1e-9, abs=1e-9)


def test_a_plausible_parameter_lies_within_the_limit() -> None:
    inertia = mechanism_named("inertia")
    assert inertia.plausible(np.array([[0.4], [0.8]]))
    assert not inertia.plausible(np.array([[0.4], [-61.0]]))


# --- the docs --------------------------------------------------------------------------------------------------------


def test_the_docs_name_every_mechanism_with_its_limit() -> None:
    text = (REPOSITORY / "docs" / "reference" / "trace.md").read_text()
    rows = {row.split("|")[1].strip(" `"): row.split("|") for row in text.splitlines() if row.startswith("| `")}
    assert [float(rows[m.name][3]) for m in EVERY] == [m.parameters[0].largest for m in EVERY]


# --- effects as changes of parameters ---


NAMES = [mechanism.name for mechanism in EVERY]
ALWAYS = DriverBasis("constant")
EVEN = uniform_ellipsoid(square_rig().outline)


def square(friction: float = 0.25, centre: tuple[float, float] = (0.0, 0.0), length: float = 1.0) -> FittedMechanics:
    """length: over that of even pressure."""
    surface = PowerSurface(np.array(centre), length * EVEN.length)
    return analytical_mechanics(square_rig().outline, square_rig().pusher_radius, friction, surface)


def effect(mechanism: str | None, *size: float, basis: DriverBasis = ALWAYS) -> Effect:
    covariance = 1e-4 * np.eye(len(size))
    return Effect(mechanism, "model_inputs", basis, np.array(size), covariance, np.ones(3))


def size_of(shift: np.ndarray) -> float:
    return float(np.sqrt(np.mean((shift * IN_METRES) ** 2)))


# --- the shift -----------------------------------------------------------------------------------------------------


def test_two_effects_together_are_both_changes_at_once() -> None:
    push, on = some(100), square()
    both = effect("contact_friction", 0.4), effect("centre_of_friction", 0.01, -0.005)
    changed = square(0.65, centre=(0.01, -0.005))
    expected = changed.displacement(push.inputs, push.duration) - on.displacement(push.inputs, push.duration)
    together, apart = joint_shift(on, both, push), sum(joint_shift(on, [one], push) for one in both)
    assert size_of(together - expected) < 5e-3 * size_of(expected)
    assert size_of(apart - expected) > 0.05 * size_of(expected)


def test_two_effects_on_one_parameter_add_up() -> None:
    push, on = some(50), square()
    two = [effect("contact_friction", 0.1), effect("contact_friction", 0.25)]
    expected = joint_shift(on, [effect("contact_friction", 0.35)], push)
    np.testing.assert_allclose(joint_shift(on, two, push), expected, atol=1e-12)


def test_an_effect_without_a_mechanism_adds_to_the_others() -> None:
    push, on = some(30), square()
    exact, generic = effect("contact_friction", 0.2), effect(None, *np.linspace(-0.1, 0.1, 18))
    expected = joint_shift(on, [exact], push) + joint_shift(on, [generic], push)
    for together in (joint_shift(on, [exact, generic], push), joint(on, [exact, generic], push).shift):
        np.testing.assert_allclose(together, expected, rtol=1e-9, atol=1e-12)


def test_the_lever_of_an_effect_without_a_mechanism_is_about_the_centre_of_friction() -> None:
    on, lever = square(centre=(0.01, -0.005)), effect(None, 0.0, 1.0, *[0.0] * 16)
    contact = float(on.outline.project(np.array([[1.0, -0.005]])).contact[0])
    push = Push(np.array([[0.05, contact, 0.3], [0.05, contact + 0.01, 0.3]]), np.full(2, 0.2), {})
    through, beside = joint_shift(on, [lever], push)[:, 0]
    assert abs(through) < 1e-9 < 1e-4 < abs(beside)


def test_an_effect_follows_its_covariate() -> None:
    push, on = some(60), square()
    later = effect("contact_friction", 0.5, basis=DriverBasis("step", ("elapsed_time",), place=500.0))
    shift, always = (joint_shift(on, [one], push) for one in (later, effect("contact_friction", 0.5)))
    after = push.covariates["elapsed_time"] >= 500.0
    assert not shift[~after].any()
    np.testing.assert_allclose(shift[after], always[after], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_responses_of_an_effect_of_size_zero_are_those_of_its_mechanism(name: str) -> None:
    push, on, mechanism = some(40, 1), square(), mechanism_named(name)
    none = effect(name, *np.zeros(len(mechanism.parameters)))
    together = joint(on, [none, effect("pusher_travel", 0.0)], push)
    assert np.array_equal(together.designs[0], mechanism.response(on, push))
    assert np.array_equal(JointEffects.of([none]).shifted(on, push)[1].transpose(0, 2, 1), together.designs[0])
    assert not together.shift.any()


@pytest.mark.parametrize("name", NAMES)
def test_shift_is_the_direct_difference_of_displacements(name: str) -> None:
    push, on, mechanism = some(30, 4), square(), mechanism_named(name)
    size = 0.3 * np.array([LARGEST[quantity] for quantity in mechanism.quantities])
    values = {quantity: on.value(quantity) + s for quantity, s in zip(mechanism.quantities, size, strict=True)}
    shift = joint_shift(on, [effect(name, *size)], push)
    assert shift == pytest.approx(displaced(on, push, values) - displaced(on, push, {}), abs=1e-15)
    assert name == "rim_pressure" or size_of(shift) > 1e-6  # the ellipsoid has no rim


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith("outline")])  # two ways at corners
def test_designs_are_derivatives_where_the_effects_act(name: str) -> None:
    push, on = some(80, 2), square()
    spread = np.array([BY_NAME[quantity].spread for quantity in mechanism_named(name).quantities])
    acting = effect(name, *(2.0 * spread))
    design = joint(on, [acting], push).designs[0]
    for k, step in enumerate(0.3 * spread * np.eye(len(spread))):
        more, less = (
            joint_shift(on, [replace(acting, coefficients=acting.coefficients + side * step)], push)
            for side in (1.0, -1.0)
        )
        difference = (more - less) / (0.6 * spread[k])
        assert size_of(design[:, :, k] - difference) <= 0.15 * size_of(difference)


def test_a_parameter_stays_within_its_plausible_range() -> None:
    push, on = some(40), square(0.25)
    far, end = (joint_shift(on, [effect("contact_friction", size)], push) for size in (9.0, 1.0))
    np.testing.assert_array_equal(far, end)
    below, none = (joint_shift(on, [effect("contact_friction", size)], push) for size in (-9.0, -1.0))
    np.testing.assert_array_equal(below, none)
    far, end = (joint_shift(on, [effect("pusher_travel", size)], push) for size in (-9.0, -0.5))
    np.testing.assert_array_equal(far, end)
