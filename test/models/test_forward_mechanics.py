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

"""The forward model obeys its own physics: symmetries, limits and supports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from forward_pushes import IN_METRES, RADIUS, SQUARE, ellipsoid, mechanics, one, pushes, size
from hypothesis import given, settings
from hypothesis import strategies as st
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.models.mechanics.motion.sweep import Rates, swept
from supports import FOUR_POINTS, THREE_POINTS

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import SHAPES, ellipse, shape_outline, square
from push_predictor.models.mechanics.forward import EXPONENT_KNOTS, PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS, MechanicsParameter
from push_predictor.models.mechanics.pressure import PressureDistribution, patch
from push_predictor.types import Array, IntArray

# --- limits and symmetries ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", SHAPES)
def test_ellipsoid_gives_the_analytical_push(shape: str) -> None:
    outline = shape_outline(shape)
    model = PushMechanics(outline, RADIUS, ellipsoid(outline), accuracy=1e-5)
    inputs, duration = pushes(40, travel=0.012)
    expected = AnalyticalPush(outline, RADIUS).displacement(inputs, duration)
    assert model.displacement({}, inputs, duration) * IN_METRES == pytest.approx(expected * IN_METRES, abs=1e-6)


def test_ellipsoid_is_near_an_even_patch_and_far_from_four_points() -> None:
    inputs, duration = pushes(100)
    ellipse_, even, four = (
        mechanics("rect1", kind).displacement({}, inputs, duration) for kind in ("ellipsoid", "patch", "four")
    )
    assert np.sqrt(np.mean(size(even - ellipse_) ** 2) / np.mean(size(even) ** 2)) < 0.09
    surface = PowerSurface(FOUR_POINTS.centre, FOUR_POINTS.length)
    approximate = PushMechanics(SQUARE, RADIUS, surface).displacement({}, inputs, duration)
    assert np.sqrt(np.mean(size(four - approximate) ** 2) / np.mean(size(four) ** 2)) > 0.06


@pytest.mark.parametrize("shape", ["rect1", "ellip2", "hex"])
def test_push_through_the_centre_along_the_normal_only_translates(shape: str) -> None:
    outline = shape_outline(shape)
    middle = 0.5 * outline.edge_starts[1] if outline.semi_axes is None else 0.25
    moved_ = mechanics(shape).displacement({}, *one(float(middle)))
    assert moved_[0] == pytest.approx([0.004, 0.0, 0.0], abs=2e-6)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.001, 0.249), st.floats(-1.3, 1.3), st.floats(0.0, 1.0))
def test_mirrored_push_gives_the_mirrored_motion(contact: float, angle: float, friction: float) -> None:
    here = mechanics().displacement({"contact_friction": friction}, *one(contact, angle))
    there = mechanics().displacement({"contact_friction": friction}, *one(0.25 - contact, -angle))
    assert there[0] * [1.0, -1.0, -1.0] * IN_METRES == pytest.approx(here[0] * IN_METRES, abs=5e-6)


@pytest.mark.parametrize("shape", ["rect1", "hex", "ellip3"])
def test_turning_a_symmetric_slider_changes_nothing(shape: str) -> None:
    (inputs, duration), order = pushes(40), shape_outline(shape).rotational_symmetry
    turned = np.column_stack([inputs[:, 0], (inputs[:, 1] + 1.0 / order) % 1.0, inputs[:, 2]])
    here, there = (mechanics(shape).displacement({}, rows, duration) for rows in (inputs, turned))
    assert there * IN_METRES == pytest.approx(here * IN_METRES, abs=8e-6)


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


def test_a_push_alone_moves_as_among_others() -> None:
    (inputs, duration), model = pushes(20), mechanics("rect1", "three")
    together = model.displacement({}, inputs, duration)
    alone = [model.displacement({}, inputs[k : k + 1], duration[k : k + 1])[0] for k in range(20)]
    assert together == pytest.approx(np.array(alone), abs=1e-6)


def test_pusher_that_slides_off_leaves_the_slider_behind() -> None:
    inputs = np.array([[0.02, SQUARE.contact_on_edge(0, 0.98), -1.3]])
    short, long = (mechanics().displacement({"contact_friction": 0.1}, inputs, np.array([t]))[0] for t in (2.0, 3.0))
    assert np.linalg.norm(short[:2]) < 0.02
    assert long * IN_METRES == pytest.approx(short * IN_METRES, abs=5e-6)


def test_no_travel_and_a_receding_pusher_move_nothing() -> None:
    assert not np.any(mechanics().displacement({}, np.array([[0.0, 0.1, 0.2]]), np.array([0.2])))
    assert not np.any(mechanics().displacement({}, np.array([[0.02, 0.1, 2.0]]), np.array([0.2])))
    assert mechanics().displacement({}, np.zeros((0, 3)), np.zeros(0)).shape == (0, 3)


# --- supports -------------------------------------------------------------------------------------------------------


def test_each_recording_has_its_own_support() -> None:
    inputs, duration = pushes(30)
    model = PushMechanics(SQUARE, RADIUS, None, {1: THREE_POINTS, 2: FOUR_POINTS})
    recording = np.arange(30) % 3
    together = model.displacement({}, inputs, duration, {"recording": recording})
    for number, kind in enumerate(("patch", "three", "four")):
        rows = recording == number
        alone = mechanics("rect1", kind).displacement({}, inputs[rows], duration[rows])
        assert together[rows] == pytest.approx(alone, abs=1e-7)


def test_rim_exponent_blends_between_the_tabulated_patches() -> None:
    inputs, duration = pushes(30)
    exact = PushMechanics(SQUARE, RADIUS, patch(SQUARE, 1.4)).displacement({}, inputs, duration)
    even, blended = (mechanics().displacement({"rim_exponent": e}, inputs, duration) for e in (0.0, 1.4))
    assert np.sqrt(np.mean(size(blended - exact) ** 2)) < 0.1 * np.sqrt(np.mean(size(exact - even) ** 2))


def test_each_push_has_its_own_rim_exponent() -> None:
    inputs, duration = pushes(6)
    exponents = np.array([0.0, 0.1, 0.3, 0.5, 0.0, 0.2])
    together = mechanics().displacement({"rim_exponent": exponents}, inputs, duration)
    for k, exponent in enumerate(exponents):
        alone = mechanics().displacement({"rim_exponent": float(exponent)}, inputs[k : k + 1], duration[k : k + 1])
        assert together[k] == pytest.approx(alone[0], abs=1e-7)
    assert (BY_NAME["rim_exponent"].low, BY_NAME["rim_exponent"].high) == (EXPONENT_KNOTS[0], EXPONENT_KNOTS[-1])


def test_rejects_a_name_that_is_no_parameter() -> None:
    with pytest.raises(KeyError, match="'friction' is no parameter"):
        mechanics().displacement({"friction": 0.3}, *one())


@pytest.mark.parametrize("parameter", [p for p in PARAMETERS if p.needs], ids=lambda p: p.name)
def test_demands_the_covariate_that_a_parameter_needs(parameter: MechanicsParameter) -> None:
    with pytest.raises(KeyError, match="push_heading"):
        mechanics().displacement({parameter.name: parameter.high / 2.0}, *one())


def test_a_disc_that_is_apart_moves_the_slider_from_its_touch_on() -> None:
    def rate(rows: IntArray, pose: Array, done: Array) -> Rates:
        push = np.tile([1.0, 0.0, 0.0], (len(rows), 1))
        return push, np.array([0.0033, 0.0])[rows] - done + pose[:, 0], np.ones(len(rows))

    pose = swept(rate, np.array([0.0075, 0.0075]), np.full(2, 0.03), 1e-3)
    assert pose[:, 0] == pytest.approx([0.0075 - 0.0033, 0.0075], abs=2.1e-5)


def test_patch_of_a_circle_does_not_turn_without_contact_friction() -> None:
    circle = PushMechanics(ellipse(0.05, 0.05), RADIUS)
    inputs, duration = pushes(10)
    assert circle.displacement({"contact_friction": 0.0}, inputs, duration)[:, 2] == pytest.approx(0.0, abs=1e-4)
