# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forward model obeys its own physics, and every parameter has the effect that its meaning states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from forward_pushes import IN_METRES, RADIUS, SQUARE, mechanics, moved, one, pushes, size
from hypothesis import given, settings
from hypothesis import strategies as st
from lynch import sweeps
from supports import THREE_POINTS
from synthetic import triangle

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import SHAPES, shape_outline, square
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS, MechanicsParameter
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


# --- whole pushes: the end, corners, a notch --------------------------------------------------------------------------


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


@pytest.mark.parametrize("wrong", [{"pusher_radius": -0.1}, {"contact_friction": np.inf}], ids=str)
def test_rejects_rig_values_out_of_range(wrong: dict[str, float]) -> None:
    with pytest.raises(RigError, match=next(iter(wrong))):
        analytical_mechanics(**{"outline": SQUARE, "pusher_radius": RADIUS, **wrong})
    with pytest.raises(RigError, match="support"):
        PowerSurface(np.zeros(2), 0.0)


# --- every parameter has the effect that its meaning states ---


def change(name: str, amount: float, push: tuple[Array, Array], heading: float = 0.0) -> Array:
    """Change of the displacement (3,) of a push on the square: edge 0 is its left side, contact 0.125 the middle."""
    base = BY_NAME[name].textbook
    more, less = (moved(mechanics(), {name: v}, *push, heading)[0] for v in (base + amount, base))
    return np.asarray(more - less)


def test_more_contact_friction_drags_the_side_along() -> None:
    # The tip slips to the left, up the side, and drags it upwards; the force turns the body from under it.
    slipping = one(0.125, 1.0)
    assert change("contact_friction", 0.1, slipping)[2] < 0.0
    assert change("contact_friction", 0.1, one(0.125, -1.0))[2] > 0.0
    assert change("contact_friction", 0.1, one(0.125, 0.05)) == pytest.approx(0.0, abs=1e-7)  # sticks


def test_friction_difference_acts_in_opposite_ways_on_the_two_slips() -> None:
    for angle, sign in ((1.0, 1.0), (-1.0, -1.0)):
        expected = change("contact_friction", 0.1 * sign, one(0.125, angle))
        assert change("friction_difference", 0.1, one(0.125, angle)) == pytest.approx(expected, abs=1e-7)


def test_friction_by_angle_is_friction_in_proportion_to_the_angle() -> None:
    push = one(0.125, 1.0, 1e-4)
    assert change("friction_by_angle", 0.1, push) == pytest.approx(change("contact_friction", 0.1, push), rel=0.02)


def test_friction_by_speed_is_friction_in_proportion_to_the_logarithm_of_the_speed() -> None:
    inputs, duration = one(0.125, 1.0, 1e-4)
    fast = inputs * [np.e / np.sin(1.0), 1.0, 1.0], duration / (np.e / np.sin(1.0))
    assert change("friction_by_speed", 0.1, fast) == pytest.approx(change("contact_friction", 0.1, fast), rel=0.02)


def test_friction_by_load_lowers_friction_where_the_force_is_small() -> None:
    """A push with a long arm needs less force; one through the centre bears the whole friction of the slider."""
    middle, end = one(0.125, 1.0, 1e-4), one(0.03, 1.0, 1e-4)
    assert np.linalg.norm(change("friction_by_load", 0.2, middle)) < 1e-3 * np.linalg.norm(
        change("contact_friction", 0.2, middle)
    )
    effect, of_friction = (change(name, 0.2, end) for name in ("friction_by_load", "contact_friction"))
    assert effect @ of_friction < -0.1 * of_friction @ of_friction


@pytest.mark.parametrize("values", [{}, {"inertia": 1.0}], ids=["slow", "with inertia"])
def test_the_body_frame_changes_nothing(values: dict[str, float]) -> None:
    """Outline and support turned and shifted in their frame are the same slider; its origin is another point of it."""
    (inputs, duration), turn, shift = pushes(8, speed=0.2), np.array(0.7), np.array([0.01, -0.006])
    duration = 0.25 * duration  # the slider turns by some degrees: a wrong origin would be off by some tenths of a mm
    inputs[:, 1] = SQUARE.contact_on_edge(np.arange(8) % 4, np.linspace(0.2, 0.8, 8))  # corners take long
    outline, points = (Outline(rotate(SQUARE.vertices, turn) + shift), rotate(THREE_POINTS.points, turn) + shift)
    other = PushMechanics(outline, RADIUS, PressureDistribution(points, THREE_POINTS.shares))
    models = (replace(model, accuracy=1e-4) for model in (mechanics("rect1", "three"), other))
    here, there = (model.displacement(values, inputs, duration) for model in models)
    normal = outline.inward_normal(inputs[:, 1])
    origin = rotate(shift, -np.arctan2(normal[:, 1], normal[:, 0]) - inputs[:, 2])
    here[:, :2] += origin - rotate(origin, here[:, 2])  # of the point that is the origin of the other frame
    assert there * IN_METRES == pytest.approx(here * IN_METRES, abs=1e-6)


def test_mass_resists_a_turn_that_grows() -> None:
    """A push through the centre moves evenly; off the centre, an effect grows with the square of the speed."""
    inputs, duration = one(0.07, 0.3)
    assert moved(mechanics(), {"inertia": 1.0}, *one())[0] == pytest.approx([0.004, 0.0, 0.0], abs=5e-6)
    effects = [
        moved(mechanics(), {"inertia": 0.5}, inputs * [k, 1.0, 1.0], duration / k)[0]
        - moved(mechanics(), {}, inputs, duration)[0]
        for k in (2.0, 4.0)
    ]
    assert np.linalg.norm(effects[1]) == pytest.approx(4.0 * np.linalg.norm(effects[0]), rel=0.1)


# --- the measurement undoes itself ---------------------------------------------------------------------------------


def recorded(values: dict[str, float], inputs: Array, duration: Array) -> tuple[Array, Array, Array]:
    """Displacements by the model with a measurement's parameters, and the same pushes without, moved by hand.

    The slider's true origin lies at `outline_x`, `outline_y` in its recorded frame and its axes at `tracker_rotation`.
    """
    shift = np.array([values.get("outline_x", 0.0), values.get("outline_y", 0.0)])
    turn = values.get("tracker_rotation", 0.0)
    normal = SQUARE.inward_normal(inputs[:, 1])
    tip = SQUARE.point(inputs[:, 1]) - RADIUS * normal
    ahead = rotate(normal, inputs[:, 2])
    true_tip, true_ahead = rotate(tip - shift, np.array(-turn)), rotate(ahead, np.array(-turn))
    nearest = SQUARE.project(true_tip)
    inward = -nearest.normal
    angle = np.arctan2(
        inward[:, 0] * true_ahead[:, 1] - inward[:, 1] * true_ahead[:, 0], np.sum(inward * true_ahead, axis=1)
    )
    true_inputs = np.column_stack([inputs[:, 0], nearest.contact, angle])
    by_hand = mechanics().displacement({}, true_inputs, duration)
    origin = rotate(rotate(-shift, np.array(-turn)), -np.arctan2(true_ahead[:, 1], true_ahead[:, 0]))
    by_hand[:, :2] += rotate(origin, by_hand[:, 2]) - origin
    return (
        mechanics().displacement(values, inputs, duration),
        by_hand,
        size(mechanics().displacement({}, inputs, duration)),
    )


@pytest.mark.parametrize(
    "values",
    [
        {"tracker_rotation": 0.2},
        {"outline_x": 0.004, "outline_y": -0.003},
        {"tracker_rotation": -0.1, "outline_x": -0.002, "outline_y": 0.005},
    ],
    ids=["rotated", "shifted", "both"],
)
def test_slider_recorded_in_another_frame_moves_as_the_true_one(values: dict[str, float]) -> None:
    draw = np.random.default_rng(4)
    edge = draw.integers(0, 4, 30)
    contact = SQUARE.contact_on_edge(edge, draw.uniform(0.2, 0.8, 30))  # off the corners, where a shift has two ways
    inputs = np.column_stack([np.full(30, 0.02), contact, draw.uniform(-1.0, 1.0, 30)])
    with_parameters, by_hand, usual = recorded(values, inputs, np.full(30, 0.2))
    assert with_parameters * IN_METRES == pytest.approx(by_hand * IN_METRES, abs=2e-6)
    assert np.sqrt(np.mean(size(by_hand) ** 2)) == pytest.approx(np.sqrt(np.mean(usual**2)), rel=0.3)


def test_push_rotation_turns_the_path_and_not_the_recorded_frame() -> None:
    straight = moved(mechanics(), {"contact_friction": 2.0, "push_rotation": 0.2}, *one())[0]
    turned = moved(mechanics(), {"contact_friction": 2.0}, *one(0.125, 0.2))[0]
    assert straight[:2] == pytest.approx(rotate(turned[:2], np.array(0.2)), abs=1e-7)
    assert straight[2] == pytest.approx(turned[2], abs=1e-6)


def test_tip_offset_across_is_another_contact() -> None:
    """To the left of a push along body x is body y: edge 0 runs down, so its contact lies earlier."""
    offset = moved(mechanics(), {"tip_offset_across": 0.005}, *one())[0]
    assert offset == pytest.approx(moved(mechanics(), {}, *one(0.125 - 0.005 / 0.36))[0], abs=1e-7)
    assert offset[2] < 0.0


def test_late_clock_is_a_tip_further_along() -> None:
    inputs, duration = one(0.125, 1.0)
    late = moved(mechanics(), {"clock_delay": 0.1}, inputs, duration)
    assert late == pytest.approx(moved(mechanics(), {"tip_offset_along": 0.002}, inputs, duration), abs=1e-12)
    # At an angle of 1 rad to the left, 2 mm further along are 2 mm sin(1) up the side, which is an earlier contact.
    up = one(0.125 - 0.002 * np.sin(1.0) / 0.36, 1.0)
    assert late == pytest.approx(moved(mechanics(), {}, *up), abs=1e-7)


def test_travel_share_lengthens_the_path() -> None:
    inputs, duration = pushes(10)
    longer = moved(mechanics(), {"travel_share": 0.1}, inputs, duration)
    assert longer == pytest.approx(moved(mechanics(), {}, inputs, 1.1 * duration), abs=1e-12)


def test_thicker_tip_touches_the_same_contact() -> None:
    inputs, duration = one(0.07, 0.4)
    thick = PushMechanics(SQUARE, RADIUS + 0.003, mechanics().support)
    assert moved(mechanics(), {"radius_error": 0.003}, inputs, duration) == pytest.approx(
        moved(thick, {}, inputs, duration), abs=1e-9
    )
