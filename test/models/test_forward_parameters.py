# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every parameter of the forward model has the effect that its meaning states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from forward_pushes import IN_METRES, RADIUS, SQUARE, mechanics, moved, one, pushes, size
from supports import THREE_POINTS

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.types import Array


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


def test_grain_is_body_anisotropy_of_a_slider_at_the_worlds_heading() -> None:
    inputs, duration = pushes(10, travel=5e-4)
    body = moved(mechanics(), {"body_anisotropy": 0.2}, inputs, duration)
    along = SQUARE.inward_normal(inputs[:, 1])
    in_body = np.arctan2(along[:, 1], along[:, 0]) + inputs[:, 2]
    world = moved(mechanics(), {"grain_x": 0.2}, inputs, duration, in_body)  # a slider that stands at zero heading
    assert world == pytest.approx(body, rel=2e-3, abs=1e-6)
    turned = moved(mechanics(), {"grain_diagonal": 0.2}, inputs, duration, in_body + np.pi / 4.0)
    assert turned == pytest.approx(body, rel=2e-3, abs=1e-6)


def test_friction_gradient_moves_the_centre_by_the_mean_squares_of_the_pressure() -> None:
    model, (inputs, duration) = mechanics("rect1", "three"), one(0.1, 0.1, 1e-4)
    x, y = (THREE_POINTS.points - THREE_POINTS.centre).T
    square_of_pressure, mixed = THREE_POINTS.shares @ (x * x), THREE_POINTS.shares @ (x * y)
    expected = moved(model, {"centre_x": 2.0 * square_of_pressure, "centre_y": 2.0 * mixed}, inputs, duration)
    # The push runs at 0.1 rad to the body's x: along that heading the slider stands at zero.
    found = moved(model, {"gradient_x": 2.0}, inputs, duration, 0.1)
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("values", [{}, {"inertia": 1.0}], ids=["slow", "with inertia"])
def test_the_place_of_the_body_frames_origin_changes_nothing(values: dict[str, float]) -> None:
    """Outline and support shifted in their frame are the same slider; its origin is another point of it."""
    (inputs, duration), shift = pushes(8, speed=0.2), np.array([0.01, -0.006])
    duration = 0.25 * duration  # the slider turns by some degrees: a wrong origin would be off by some tenths of a mm
    inputs[:, 1] = SQUARE.contact_on_edge(np.arange(8) % 4, np.linspace(0.2, 0.8, 8))  # corners take long
    shifted = PushMechanics(
        Outline(SQUARE.vertices + shift),
        RADIUS,
        PressureDistribution(THREE_POINTS.points + shift, THREE_POINTS.shares),
    )
    models = (replace(model, accuracy=1e-4) for model in (mechanics("rect1", "three"), shifted))
    here, there = (model.displacement(values, inputs, duration) for model in models)
    normal = SQUARE.inward_normal(inputs[:, 1])
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
