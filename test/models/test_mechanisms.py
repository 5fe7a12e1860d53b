# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of mechanisms and their responses; effects as changes of parameters, exact for large ones and together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drifting_models import DRIFT, pushes, slippery
from repository import REPOSITORY
from synthetic import square_rig, triangle

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
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.types import Array

EVERY = (*LIBRARY, *REFINEMENTS)
EVERY_MECHANISM = pytest.mark.parametrize("mechanism", EVERY, ids=lambda m: m.name)
OUTLINES = {name: shape_outline(name) for name in ("rect1", "ellip1", "ellip2", "ellip3", "hex")} | {"tri": triangle()}
IN_METRES = np.array([1.0, 1.0, 0.04])  # a turn counts as the path of a point 4 cm from the centre

# Under a reflection of body, table and push in the body's x axis each parameter keeps its sign (1) or changes it (-1).
MIRRORED = {
    "contact_friction": [1], "contact_asymmetry": [-1], "pressure_spread": [1], "centre_of_friction": [1, -1],
    "pushing_height": [1], "body_anisotropy": [1, -1], "anisotropic_friction": [1, -1], "friction_gradient": [1, -1],
    "tilted_surface": [1, -1], "inertia": [1], "pusher_radius": [1], "pusher_travel": [1],
}  # fmt: skip
FIXED_TO_THE_BODY = ("centre_of_friction", "body_anisotropy")


def mechanics_of(outline: str, friction: float = 0.25) -> FittedMechanics:
    return analytical_mechanics(OUTLINES[outline], 0.00475, friction)


def patched(outline: str) -> FittedMechanics:
    return FittedMechanics(PushMechanics(OUTLINES[outline], 0.00475), {"contact_friction": 0.25})


def some(n: int, seed: int = 0, duration: float = 0.2) -> Push:
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(0.02, 0.1, n), rng.random(n), rng.uniform(-1.0, 1.0, n)])
    return Push(inputs, np.full(n, duration), {"slider_heading": rng.uniform(-3.0, 3.0, n)})


def altered(push: Push, contact: Array | None = None, angle: float = 1.0, turn: float = 0.0) -> Push:
    """The pushes at other contacts, with angles (and headings) times `angle`, sliders turned by `turn`."""
    velocity, old, beta = push.inputs.T
    heading = angle * push.covariates["slider_heading"] + turn
    inputs = np.column_stack([velocity, old if contact is None else contact, angle * beta])
    return Push(inputs, push.duration, {"slider_heading": heading})


def size(response: Array) -> Array:
    """Root mean square (p,) over windows and outputs."""
    return np.asarray(np.sqrt(np.mean((response * IN_METRES[None, :, None]) ** 2, axis=(0, 1))))


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
    turned = altered(push, turn=0.7)
    same = np.array_equal(mechanism.response(patched("rect1"), push), mechanism.response(patched("rect1"), turned))
    assert mechanism.needs == (() if same else ("slider_heading",))


@EVERY_MECHANISM
def test_a_response_is_the_central_difference_of_displacements(mechanism: Mechanism) -> None:
    """Over half a standard deviation of the parameter's prior to both sides, and not below zero where that is none."""
    fitted, push = patched("rect1"), some(12)
    response = mechanism.response(fitted, push)
    assert response.shape == (12, 3, len(mechanism.quantities))
    normal = fitted.outline.inward_normal(push.inputs[:, 1])
    heading = push.covariates["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + push.inputs[:, 2]
    for k, name in enumerate(mechanism.quantities):
        step, value = 0.5 * PARAMETERS_BY_NAME[name].spread, fitted.value(name)
        low, high = value - step, value + step
        if name in ("inertia", "contact_friction"):
            low = max(low, 0.0)
        more, less = (
            fitted.mechanics.displacement(
                {**fitted.values, name: end}, push.inputs, push.duration, {"push_heading": heading}
            )
            for end in (high, low)
        )
        expected = (more - less) / (high - low)
        assert response[:, :, k] * IN_METRES == pytest.approx(expected * IN_METRES, rel=1e-9, abs=1e-9)


def test_a_plausible_parameter_lies_within_the_limit() -> None:
    inertia = mechanism_named("inertia")
    assert inertia.plausible(np.array([[0.4], [0.8]]))
    assert not inertia.plausible(np.array([[0.4], [-61.0]]))


# --- every mechanism on every outline --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["friction_by_load", "outline_rotation"])
def test_a_circle_has_no_response_to_what_its_symmetry_hides(name: str) -> None:
    """Every normal of a circle runs through its centre and needs the same force; a turned circle is the same."""
    assert np.all(size(mechanism_named(name).response(patched("ellip1"), some(30))) < 1e-5)


@pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda m: m.name)
def test_a_mirrored_push_has_the_mirrored_response(mechanism: Mechanism) -> None:
    push = some(40)
    contact = np.random.default_rng(1).uniform(0.001, 0.249, 40)  # on the side that the x axis cuts in half
    here = mechanism.response(mechanics_of("rect1"), altered(push, contact))
    there = mechanism.response(mechanics_of("rect1"), altered(push, 0.25 - contact, angle=-1.0))
    expected = here * np.array([1.0, -1.0, -1.0])[None, :, None] * np.array(MIRRORED[mechanism.name])
    assert np.all(size(there - expected) < 2e-3 * size(here))


@pytest.mark.parametrize(("outline", "order"), [("hex", 6), ("ellip2", 2)])
@pytest.mark.parametrize("mechanism", [m for m in LIBRARY if m.name not in FIXED_TO_THE_BODY], ids=lambda m: m.name)
def test_response_is_the_same_on_equivalent_sides(mechanism: Mechanism, outline: str, order: int) -> None:
    push = some(30)
    contact = np.random.default_rng(1).uniform(0.001, 1.0 / order - 0.001, 30)
    here = mechanism.response(mechanics_of(outline), altered(push, contact))
    turned = altered(push, contact + 1.0 / order, turn=-2.0 * np.pi / order)
    there = mechanism.response(mechanics_of(outline), turned)
    assert np.all(size(there - here) < 2e-3 * size(here))


@pytest.mark.parametrize(("name", "sign"), [("anisotropic_friction", 1), ("tilted_surface", -1), ("inertia", 1)])
def test_anisotropy_is_even_and_slope_odd_under_half_a_turn(name: str, sign: int) -> None:
    push = some(40)
    here, there = (mechanism_named(name).response(mechanics_of("hex"), p) for p in (push, altered(push, turn=np.pi)))
    assert there == pytest.approx(sign * here, abs=1e-9)


# --- the docs --------------------------------------------------------------------------------------------------------


def test_the_docs_name_every_mechanism_with_its_limit() -> None:
    text = (REPOSITORY / "docs" / "reference" / "trace.md").read_text()
    rows = {row.split("|")[1].strip(" `"): row.split("|") for row in text.splitlines() if row.startswith("| `")}
    assert [float(rows[m.name][3]) for m in EVERY] == [m.parameters[0].largest for m in EVERY]


# --- effects as changes of parameters ---


NAMES = [mechanism.name for mechanism in EVERY]
ALWAYS = DriverBasis("constant")


CONTACT, ANGLE = 1, 2  # columns of the inputs


def made(n: int, seed: int = 0, duration: float = 0.2) -> Push:
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(0.02, 0.1, n), rng.random(n), rng.uniform(-1.0, 1.0, n)])
    covariates = {"slider_heading": rng.uniform(-3.0, 3.0, n), "elapsed_time": np.linspace(0.0, 1000.0, n)}
    return Push(inputs, np.full(n, duration), covariates)


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
    push, on = made(100), square()
    both = effect("contact_friction", 0.4), effect("centre_of_friction", 0.01, -0.005)
    changed = square(0.65, centre=(0.01, -0.005))
    expected = changed.displacement(push.inputs, push.duration) - on.displacement(push.inputs, push.duration)
    together, apart = joint_shift(on, both, push), sum(joint_shift(on, [one], push) for one in both)
    assert size_of(together - expected) < 5e-3 * size_of(expected)
    assert size_of(apart - expected) > 0.05 * size_of(expected)


def test_two_effects_on_one_parameter_add_up() -> None:
    push, on = made(50), square()
    two = [effect("contact_friction", 0.1), effect("contact_friction", 0.25)]
    expected = joint_shift(on, [effect("contact_friction", 0.35)], push)
    np.testing.assert_allclose(joint_shift(on, two, push), expected, atol=1e-12)


def test_an_effect_without_a_mechanism_adds_to_the_others() -> None:
    push, on = made(30), square()
    exact, generic = effect("contact_friction", 0.2), effect(None, *np.linspace(-0.1, 0.1, 18))
    expected = joint_shift(on, [exact], push) + joint_shift(on, [generic], push)
    for together in (joint_shift(on, [exact, generic], push), joint(on, [exact, generic], push).shift):
        np.testing.assert_allclose(together, expected, rtol=1e-9, atol=1e-12)


def test_an_effect_follows_its_covariate() -> None:
    push, on = made(60), square()
    later = effect("contact_friction", 0.5, basis=DriverBasis("step", ("elapsed_time",), place=500.0))
    shift, always = (joint_shift(on, [one], push) for one in (later, effect("contact_friction", 0.5)))
    after = push.covariates["elapsed_time"] >= 500.0
    assert not shift[~after].any()
    np.testing.assert_allclose(shift[after], always[after], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_responses_of_an_effect_of_size_zero_are_those_of_its_mechanism(name: str) -> None:
    push, on, mechanism = made(40, 1), square(), mechanism_named(name)
    none = effect(name, *np.zeros(len(mechanism.parameters)))
    together = joint(on, [none, effect("pusher_travel", 0.0)], push)
    assert np.array_equal(together.designs[0], mechanism.response(on, push))
    assert np.array_equal(JointEffects.of([none]).shifted(on, push)[1].transpose(0, 2, 1), together.designs[0])
    assert not together.shift.any()


@pytest.mark.parametrize("name", NAMES)
def test_shift_is_the_direct_difference_of_displacements(name: str) -> None:
    """Of the forward model itself, whose headings are those of the pushes."""
    push, on, mechanism = made(30, 4), square(), mechanism_named(name)
    size = 0.3 * np.array([LARGEST[quantity] for quantity in mechanism.quantities])
    normal = on.outline.inward_normal(push.inputs[:, 1])
    heading = push.covariates["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + push.inputs[:, 2]
    values = {quantity: on.value(quantity) + s for quantity, s in zip(mechanism.quantities, size, strict=True)}
    changed, plain = (
        on.mechanics.displacement(v, push.inputs, push.duration, {"push_heading": heading})
        for v in ({**on.values, **values}, on.values)
    )
    shift = joint_shift(on, [effect(name, *size)], push)
    assert shift == pytest.approx(changed - plain, abs=1e-15)
    assert name == "rim_pressure" or size_of(shift) > 1e-6  # the ellipsoid has no rim


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith("outline")])  # two ways at corners
def test_designs_are_derivatives_where_the_effects_act(name: str) -> None:
    push, on = made(80, 2), square()
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
    push, on = made(40), square(0.25)
    far, end = (joint_shift(on, [effect("contact_friction", size)], push) for size in (9.0, 1.0))
    np.testing.assert_array_equal(far, end)
    below, none = (joint_shift(on, [effect("contact_friction", size)], push) for size in (-9.0, -1.0))
    np.testing.assert_array_equal(below, none)
    far, end = (joint_shift(on, [effect("pusher_travel", size)], push) for size in (-9.0, -0.5))
    np.testing.assert_array_equal(far, end)


# --- in a model ----------------------------------------------------------------------------------------------------


# --- estimation ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(60), square_rig(), "analytical", name="deployed")


def found(deployed: PushModel, table: PushTable, mechanism: str, basis: DriverBasis, *, of_size: bool = True) -> Effect:
    evidence = evidence_of(deployed, table)
    fit = fitted(FitRows(evidence), [candidate(evidence, mechanism, "elapsed_time", basis)])
    return estimated(fit, of_size=of_size)[0][0]


def test_the_size_of_a_large_effect_is_found(deployed: PushModel) -> None:
    """Friction grows from 0.3 to 0.9: by its first derivative alone it would come out a fifth too small."""
    table = pushes(100, 5, slippery(0.4))
    estimate = found(deployed, table, "contact_friction", DRIFT)
    sd = float(np.sqrt(estimate.covariance[0, 0]))
    assert abs(float(estimate.coefficients[0]) - 0.4) < 3.0 * sd < 0.1


@pytest.mark.parametrize(("differ_by", "limit"), [(CONTACT, 0.5), (ANGLE, 0.0)])
def test_where_pushes_of_different_inputs_disagree_the_interval_is_wider(
    deployed: PushModel, differ_by: int, limit: float
) -> None:
    """Real mechanics err by contact and angle: pushes of one angle, however many, do not make the size more certain."""
    weak, strong = pushes(100, 5, slippery(0.1)), pushes(100, 5, slippery(0.3))
    on_one_side = weak.inputs[:, differ_by] > limit
    mixed = replace(weak, outcomes=np.where(on_one_side[:, None], strong.outcomes, weak.outcomes))
    narrow, wide = (found(deployed, mixed, "contact_friction", DRIFT, of_size=of_size) for of_size in (False, True))
    assert 0.1 < wide.coefficients[0] < 0.3
    assert wide.covariance[0, 0] > 2.5**2 * narrow.covariance[0, 0]
