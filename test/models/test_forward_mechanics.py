# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forward model obeys its own physics: symmetries, limits and supports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from forward_pushes import IN_METRES, RADIUS, SQUARE, mechanics, one, pushes, size
from hypothesis import given, settings
from hypothesis import strategies as st
from lynch import in_equal_steps, sweeps
from supports import THREE_POINTS
from synthetic import triangle

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import SHAPES, ellipse, shape_outline, square
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import PARAMETERS, MechanicsParameter
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.models.mechanics.surface import PowerSurface, uniform_ellipsoid
from push_predictor.types import Array

TRIANGLE = triangle()
OUTLINES = {name: shape_outline(name) for name in SHAPES} | {"triangle": TRIANGLE}
EVERY_OUTLINE = pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)


def world_pose(outline: Outline, inputs: Array, moved: Array) -> Array:
    """Poses (n, 3) in the frame of the first ones, from displacements in push frames."""
    normal = outline.inward_normal(inputs[:, 1])
    turn = np.arctan2(normal[:, 1], normal[:, 0]) + inputs[:, 2]
    return np.column_stack([rotate(moved[:, :2], turn), moved[:, 2]])


# --- limits and symmetries -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["ellipsoid", "patch"])
@EVERY_OUTLINE
def test_push_through_the_centre_along_the_normal_only_translates(outline: Outline, kind: str) -> None:
    middle = 0.25 if outline.semi_axes is not None else outline.edge_starts[1] * (1 / 3 if outline is TRIANGLE else 0.5)
    model = PushMechanics(outline, RADIUS, uniform_ellipsoid(outline) if kind == "ellipsoid" else None)
    exact = 1e-9 if kind == "ellipsoid" else 2e-6
    assert model.displacement({}, *one(float(middle)))[0] == pytest.approx([0.004, 0.0, 0.0], abs=exact)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.001, 0.249), st.floats(-1.3, 1.3), st.floats(0.0, 1.0))
def test_mirrored_push_gives_the_mirrored_motion(contact: float, angle: float, friction: float) -> None:
    here = mechanics().displacement({"contact_friction": friction}, *one(contact, angle))
    there = mechanics().displacement({"contact_friction": friction}, *one(0.25 - contact, -angle))
    assert there[0] * [1.0, -1.0, -1.0] * IN_METRES == pytest.approx(here[0] * IN_METRES, abs=5e-6)


def test_turning_outline_and_support_together_changes_nothing() -> None:
    turn, (inputs, duration) = 0.7, pushes(40)
    turned = PushMechanics(
        Outline(rotate(SQUARE.vertices, np.array(turn))),
        RADIUS,
        PressureDistribution(rotate(THREE_POINTS.points, np.array(turn)), THREE_POINTS.shares),
    )
    here, there = (model.displacement({}, inputs, duration) for model in (mechanics("rect1", "three"), turned))
    assert there * IN_METRES == pytest.approx(here * IN_METRES, abs=1e-5)


def test_scaling_all_lengths_scales_the_motion() -> None:
    inputs, duration = pushes(40)
    wide = PushMechanics(square(0.18), 2 * RADIUS).displacement({}, inputs * [2.0, 1.0, 1.0], duration)
    small = mechanics().displacement({}, inputs, duration)
    assert wide * IN_METRES == pytest.approx(small * [2.0, 2.0, 1.0] * IN_METRES, abs=5e-6)


@pytest.mark.parametrize("kind", ["patch", "three"])
def test_displacement_depends_on_the_travel_and_not_on_the_speed(kind: str) -> None:
    inputs, duration = pushes(40)
    slow, fast = (mechanics("rect1", kind).displacement({}, inputs * [k, 1.0, 1.0], duration / k) for k in (1.0, 5.0))
    assert fast == pytest.approx(slow, abs=1e-9)


@pytest.mark.parametrize(("kind", "travel"), [("patch", 0.004), ("three", 0.02)])
def test_finer_integration_changes_little(kind: str, travel: float) -> None:
    (inputs, duration), model = pushes(60, travel=travel), mechanics("rect1", kind)
    usual, half, fine = (
        replace(model, accuracy=accuracy).displacement({}, inputs, duration) for accuracy in (1e-3, 5e-4, 1e-5)
    )
    assert np.all(size(usual - half) < 1e-3 * (size(fine) + 0.3 * travel))
    assert np.all(size(usual - fine) < 1e-3 * (size(fine) + 0.3 * travel))
    assert np.sqrt(np.mean(size(usual - fine) ** 2)) < 3e-4 * np.sqrt(np.mean(size(fine) ** 2))


def test_pusher_that_slides_off_leaves_the_slider_behind() -> None:
    inputs = np.array([[0.02, SQUARE.contact_on_edge(0, 0.98), -1.3]])
    short, long = (mechanics().displacement({"contact_friction": 0.1}, inputs, np.array([t]))[0] for t in (2.0, 3.0))
    assert np.linalg.norm(short[:2]) < 0.02
    assert long * IN_METRES == pytest.approx(short * IN_METRES, abs=5e-6)


def test_no_travel_and_a_receding_pusher_move_nothing() -> None:
    assert not np.any(mechanics().displacement({}, np.array([[0.0, 0.1, 0.2]]), np.array([0.2])))
    assert not np.any(mechanics().displacement({}, np.array([[0.02, 0.1, 2.0]]), np.array([0.2])))
    assert mechanics().displacement({}, np.zeros((0, 3)), np.zeros(0)).shape == (0, 3)


# --- supports --------------------------------------------------------------------------------------------------------


def test_rejects_a_name_that_is_no_parameter() -> None:
    with pytest.raises(KeyError, match="'friction' is no parameter"):
        mechanics().displacement({"friction": 0.3}, *one())


@pytest.mark.parametrize("parameter", [p for p in PARAMETERS if p.needs], ids=lambda p: p.name)
def test_demands_the_covariate_that_a_parameter_needs(parameter: MechanicsParameter) -> None:
    with pytest.raises(KeyError, match="push_heading"):
        mechanics().displacement({parameter.name: parameter.high / 2.0}, *one())


def test_patch_of_a_circle_does_not_turn_without_contact_friction() -> None:
    circle = PushMechanics(ellipse(0.05, 0.05), RADIUS)
    inputs, duration = pushes(10)
    assert circle.displacement({"contact_friction": 0.0}, inputs, duration)[:, 2] == pytest.approx(0.0, abs=1e-4)


# --- whole pushes on the ellipsoid, against closed forms and fine steps ----------------------------------------------


def test_displacements_are_as_accurate_as_asked_for() -> None:
    """Steps of 4e-5 m of another method, on another solution of the contact; in them corners blur to some 1e-5."""
    outline, (inputs, duration) = OUTLINES["rect1"], pushes(30, seed=3, travel=0.0145)
    surface = uniform_ellipsoid(outline)
    path = sweeps(outline, RADIUS, inputs, duration)
    coarse, exact = (in_equal_steps(path, surface, 0.3, steps) for steps in (256, 512))
    known = size(coarse - exact)
    assert np.quantile(known, 0.7) < 1e-8
    for accuracy in (1e-3, 1e-4, 1e-6):
        found = PushMechanics(outline, RADIUS, surface, accuracy=accuracy).displacement({}, inputs, duration)
        error = size(world_pose(outline, inputs, found) - exact)
        assert np.all(error < accuracy * (size(exact) + 0.01 * 0.0145) + 4.0 * known), accuracy


@pytest.mark.parametrize("travel", [0.004, 0.0145])
@EVERY_OUTLINE
def test_disc_ends_on_the_outline_or_outside_it(outline: Outline, travel: float) -> None:
    model, (inputs, duration) = analytical_mechanics(outline, RADIUS), pushes(300, travel=travel)
    pose = world_pose(outline, inputs, model.displacement(inputs, duration))
    gap, approaching = sweeps(outline, RADIUS, inputs, duration).at_end(pose)
    assert np.min(gap) > -1e-7
    assert np.max(np.abs(gap[approaching > 0.02])) < 1e-6  # who has not left touches
    assert np.mean(approaching > 0.02) > 0.8


@pytest.mark.parametrize(
    ("contact", "angle", "travel"), [(0.2534, 0.9333, 0.02055), (0.7371, -1.1509, 0.01792), (0.7483, -1.13, 0.0192)]
)
def test_a_corner_that_only_the_last_stages_of_a_step_see_is_not_stepped_over(
    contact: float, angle: float, travel: float
) -> None:
    model, inputs, duration = analytical_mechanics(SQUARE, RADIUS), np.array([[travel, contact, angle]]), np.ones(1)
    finely = replace(model.mechanics, accuracy=3e-7).displacement({}, inputs, duration)
    found = model.displacement(inputs, duration)
    assert np.all(np.abs(found - finely) < 1e-4 * np.linalg.norm(finely[:, :2]) / [1.0, 1.0, 0.03])
    gap, _ = sweeps(SQUARE, RADIUS, inputs, duration).at_end(world_pose(SQUARE, inputs, found))
    assert gap[0] > -1e-7


@pytest.mark.parametrize("share", [0.9, 0.98])
def test_a_tip_that_slips_over_a_corner_drags_it_no_further(share: float) -> None:
    """The last touch of a tip is that of the corner: the slider moves as if the path had ended there."""
    model = analytical_mechanics(SQUARE, RADIUS, 0.1)
    contact = float(SQUARE.contact_on_edge(0, share))
    travels = np.linspace(0.0, 0.06, 61)[1:]
    moved = model.displacement(np.tile([1.0, contact, -1.3], (60, 1)), travels)
    steps = np.linalg.norm(np.diff(moved[:, :2], axis=0), axis=1)
    left = int(np.argmax(steps < 1e-9))
    assert 1 < left < 50 and np.all(steps[:left] > 1e-9) and np.all(steps[left:] < 1e-4 * np.linalg.norm(moved[-1]))


@pytest.mark.parametrize("aside", [0.0, 0.1, 0.3, 0.5])
def test_a_disc_crosses_a_notch_and_pushes_its_far_side(aside: float) -> None:
    """It leaves the near side, moves freely, and from its touch on pushes as one that starts there.

    At an angle aside it comes near to the far side long before it touches.
    """
    notch = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.06], [0.07, 0.06], [0.07, 0.03], [0.03, 0.03], [0.03, 0.06], [0.0, 0.06]]
    outline, y = Outline(np.array(notch)), 0.036
    model = analytical_mechanics(outline, RADIUS, 0.3, PowerSurface(np.array([0.05, 0.05]), 0.03))
    across = 0.04 - 2.0 * RADIUS
    ends = np.array([[0.03, y], [0.07, y + across * np.tan(aside)]])
    near, far = outline.project(ends).contact
    assert outline.inward_normal(np.array([near, far])) == pytest.approx(np.array([[-1.0, 0.0], [1.0, 0.0]]))
    free = across / np.cos(aside)
    found, expected = (
        model.displacement(np.array([[travel, contact, angle]]), np.ones(1))[0]
        for travel, contact, angle in ((free + 0.005, near, np.pi + aside), (0.005, far, aside))
    )
    assert np.linalg.norm(expected[:2]) > 3e-3
    assert found * IN_METRES == pytest.approx(expected * IN_METRES, abs=3e-5)


@pytest.mark.parametrize("name", ["rect1", "ellip2", "hex"])
def test_the_ellipsoid_keeps_the_symmetries_to_its_accuracy(name: str) -> None:
    outline = shape_outline(name)
    model, (inputs, duration) = analytical_mechanics(outline, RADIUS), pushes(100)
    first = 0.25 if name == "rect1" else 0.0  # its mirror axis passes through the middle of edge 0, an eighth along
    other = np.column_stack([inputs[:, 0], (first - inputs[:, 1]) % 1.0, -inputs[:, 2]])
    turned = np.column_stack([inputs[:, 0], (inputs[:, 1] + 1.0 / outline.rotational_symmetry) % 1.0, inputs[:, 2]])
    here, mirrored, around = (model.displacement(rows, duration)
                              for rows in (inputs, other, turned))  # fmt: skip
    assert mirrored * [1.0, -1.0, -1.0] == pytest.approx(here, abs=3e-7)
    assert around[:, :2] == pytest.approx(here[:, :2], abs=3e-7)


@pytest.mark.parametrize("wrong", [{"pusher_radius": -0.1}, {"contact_friction": np.inf}], ids=str)
def test_rejects_rig_values_out_of_range(wrong: dict[str, float]) -> None:
    with pytest.raises(RigError, match=next(iter(wrong))):
        analytical_mechanics(**{"outline": SQUARE, "pusher_radius": RADIUS, **wrong})
    with pytest.raises(RigError, match="support"):
        PowerSurface(np.zeros(2), 0.0)
