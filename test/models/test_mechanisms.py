# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table of mechanisms: their parameters, their responses, and mechanics solved by other methods."""

from __future__ import annotations

import numpy as np
import pytest
from repository import REPOSITORY
from synthetic import triangle

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME as PARAMETERS_BY_NAME
from push_predictor.models.mechanisms import LARGEST, LIBRARY, REFINEMENTS, Mechanism, mechanism_named
from push_predictor.models.pushes import Push
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


def pushes(n: int, seed: int = 0, duration: float = 0.2) -> Push:
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
    push = pushes(12)
    turned = altered(push, turn=0.7)
    same = np.array_equal(mechanism.response(patched("rect1"), push), mechanism.response(patched("rect1"), turned))
    assert mechanism.needs == (() if same else ("slider_heading",))


@EVERY_MECHANISM
def test_a_response_is_the_central_difference_of_displacements(mechanism: Mechanism) -> None:
    """Over half a standard deviation of the parameter's prior to both sides, and not below zero where that is none."""
    fitted, push = patched("rect1"), pushes(12)
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
    assert np.all(size(mechanism_named(name).response(patched("ellip1"), pushes(30))) < 1e-5)


@pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda m: m.name)
def test_a_mirrored_push_has_the_mirrored_response(mechanism: Mechanism) -> None:
    push = pushes(40)
    contact = np.random.default_rng(1).uniform(0.001, 0.249, 40)  # on the side that the x axis cuts in half
    here = mechanism.response(mechanics_of("rect1"), altered(push, contact))
    there = mechanism.response(mechanics_of("rect1"), altered(push, 0.25 - contact, angle=-1.0))
    expected = here * np.array([1.0, -1.0, -1.0])[None, :, None] * np.array(MIRRORED[mechanism.name])
    assert np.all(size(there - expected) < 2e-3 * size(here))


@pytest.mark.parametrize(("outline", "order"), [("hex", 6), ("ellip2", 2)])
@pytest.mark.parametrize("mechanism", [m for m in LIBRARY if m.name not in FIXED_TO_THE_BODY], ids=lambda m: m.name)
def test_response_is_the_same_on_equivalent_sides(mechanism: Mechanism, outline: str, order: int) -> None:
    push = pushes(30)
    contact = np.random.default_rng(1).uniform(0.001, 1.0 / order - 0.001, 30)
    here = mechanism.response(mechanics_of(outline), altered(push, contact))
    turned = altered(push, contact + 1.0 / order, turn=-2.0 * np.pi / order)
    there = mechanism.response(mechanics_of(outline), turned)
    assert np.all(size(there - here) < 2e-3 * size(here))


@pytest.mark.parametrize(("name", "sign"), [("anisotropic_friction", 1), ("tilted_surface", -1), ("inertia", 1)])
def test_anisotropy_is_even_and_slope_odd_under_half_a_turn(name: str, sign: int) -> None:
    push = pushes(40)
    here, there = (mechanism_named(name).response(mechanics_of("hex"), p) for p in (push, altered(push, turn=np.pi)))
    assert there == pytest.approx(sign * here, abs=1e-9)


# --- the docs --------------------------------------------------------------------------------------------------------


def test_the_docs_name_every_mechanism_with_its_limit() -> None:
    text = (REPOSITORY / "docs" / "reference" / "trace.md").read_text()
    rows = {row.split("|")[1].strip(" `"): row.split("|") for row in text.splitlines() if row.startswith("| `")}
    assert [float(rows[m.name][3]) for m in EVERY] == [m.parameters[0].largest for m in EVERY]
