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

"""The quasi-static model obeys its own physics: friction cone, limit surface, symmetries, and converges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from push_predictor.models.mechanics.analytical import ACCURACY, AnalyticalPush, fit_analytical
from push_predictor.models.mechanics.limit_surface import Support, contact_force, uniform_support
from push_predictor.models.mechanics.motion.recorded_push import TruePush
from support_points import support_of_points

from push_predictor.errors import RequestError, RigError, TrainingError
from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import SHAPES, ellipse, shape_outline, square, transformed
from push_predictor.models.mechanics.forward import Motion
from push_predictor.models.mechanics.parameters import RowValues
from push_predictor.models.mechanics.pressure import patch

RADIUS = 0.00475
LEVER = 0.03  # m, at which a turn is compared with a shift
TRIANGLE = Outline(np.array([[-0.05, -0.05], [0.1, -0.05], [-0.05, 0.1]]))
OUTLINES = {name: shape_outline(name) for name in SHAPES} | {"triangle": TRIANGLE}
EVERY_OUTLINE = pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)

coordinates = st.floats(-0.06, 0.06)
frictions = st.floats(0.0, 1.5)
directions = st.floats(-1.5, 1.5)


def pushes(n: int, seed: int = 0, travel: float = 0.004, speed: float = 0.02) -> tuple[np.ndarray, np.ndarray]:
    """Random pushes all around a slider: inputs (n, 3) and durations (n,)."""
    draw = np.random.default_rng(seed)
    inputs = np.column_stack([np.full(n, speed), draw.uniform(0.0, 1.0, n), draw.uniform(-1.5, 1.5, n)])
    return inputs, np.full(n, travel / speed)


def sweep(start: np.ndarray, ahead: np.ndarray, travel: np.ndarray, radius: float = RADIUS) -> TruePush:
    """Straight paths of a disc from start (n, 2) in the frame of the slider's first pose."""
    return TruePush(
        start, np.full(len(travel), radius), ahead, travel, np.ones_like(travel), ahead, np.zeros_like(start)
    )


def sweeps(model: AnalyticalPush, inputs: np.ndarray, duration: np.ndarray) -> TruePush:
    """The same pushes as paths of the disc in the body frame."""
    normal = model.outline.inward_normal(inputs[:, 1])
    start = model.outline.point(inputs[:, 1]) - model.pusher_radius * normal
    return sweep(start, rotate(normal, inputs[:, 2]), inputs[:, 0] * duration, model.pusher_radius)


def slide(model: AnalyticalPush, path: TruePush) -> np.ndarray:
    """Poses (n, 3) after the paths."""
    return model.mechanics.poses(of(model, path), path)


def of(model: AnalyticalPush, path: TruePush) -> RowValues:
    return RowValues({"contact_friction": model.contact_friction}, len(path.travel), {})


def size(displacement: np.ndarray) -> np.ndarray:
    return np.linalg.norm(displacement * [1.0, 1.0, LEVER], axis=-1)


# --- limit surface -------------------------------------------------------------------------------------------------


def one_contact(point: tuple[float, float], angle: float, friction: float, support: Support) -> dict[str, np.ndarray]:
    """Twist of a slider touched at a point with inward normal +x, and the wrench that the ellipsoid gives for it."""
    velocity = np.array([[np.cos(angle), np.sin(angle)]])
    x, y = np.subtract(point, support.centre) / support.length
    p, q, along, across = (np.array([value]) for value in (-y, x, np.cos(angle), np.sin(angle)))
    push, rub, slips = contact_force(1.0 + p * p, p * q, 1.0 + q * q, along, across, friction)
    vx, vy, spin, slip = push[0], rub[0], (p * push + q * rub)[0] / support.length, slips[0]
    vx, vy = vx + spin * support.centre[1], vy - spin * support.centre[0]
    of_contact = np.array([vx - spin * point[1], vy + spin * point[0]])
    of_centre = np.array([vx - spin * support.centre[1], vy + spin * support.centre[0]])
    arm = np.subtract(point, support.centre)
    return {
        "pusher": velocity[0], "contact": of_contact, "force": of_centre, "spin": spin, "slip": slip, "arm": arm,
        "moment": support.length**2 * spin,
    }  # fmt: skip


supports = st.builds(Support, st.tuples(coordinates, coordinates), st.floats(0.01, 0.08))


@settings(max_examples=100, deadline=None)
@given(st.tuples(coordinates, coordinates), directions, frictions, supports)
def test_wrench_acts_at_contact_inside_friction_cone(point, angle, friction, support):
    move = one_contact(point, angle, friction, support)
    force, arm = move["force"], move["arm"]
    assert move["moment"] == pytest.approx(arm[0] * force[1] - arm[1] * force[0], abs=1e-12)
    assert force[0] >= 0.0
    assert abs(force[1]) <= friction * force[0] + 1e-12


@settings(max_examples=100, deadline=None)
@given(st.tuples(coordinates, coordinates), directions, frictions, supports)
def test_contact_velocity_obeys_coulomb_friction(point, angle, friction, support):
    move = one_contact(point, angle, friction, support)
    relative = move["pusher"] - move["contact"]
    assert relative[0] == pytest.approx(0.0, abs=1e-10)  # neither separation nor penetration
    if move["slip"] == 0:
        assert relative[1] == pytest.approx(0.0, abs=1e-10)
    else:
        assert relative[1] * move["slip"] >= -1e-12
        assert move["force"][1] == pytest.approx(move["slip"] * friction * move["force"][0], abs=1e-12)


@settings(max_examples=80, deadline=None)
@given(st.tuples(coordinates, coordinates), directions, frictions, supports)
def test_pushing_dissipates_energy(point, angle, friction, support):
    move = one_contact(point, angle, friction, support)
    into_surface = move["force"] @ move["force"] + move["moment"] * move["spin"]
    by_pusher = move["force"] @ move["pusher"]
    at_contact = move["force"] @ (move["pusher"] - move["contact"])
    assert into_surface > 0.0
    assert at_contact >= -1e-12
    assert by_pusher == pytest.approx(into_surface + at_contact, abs=1e-10)


def test_motion_is_parallel_to_the_gradient_of_the_limit_surface():
    support, step = Support((0.004, -0.007), 0.03), 1e-7
    move = one_contact((-0.045, 0.02), 0.4, 0.3, support)
    twist = np.array([*move["force"], move["spin"]])
    wrench = np.array([*move["force"], move["moment"]])

    def surface(w: np.ndarray) -> float:
        return float(w[0] ** 2 + w[1] ** 2 + (w[2] / support.length) ** 2)

    gradient = np.array([(surface(wrench + step * e) - surface(wrench - step * e)) / (2 * step) for e in np.eye(3)])
    assert np.cross(twist / np.linalg.norm(twist), gradient / np.linalg.norm(gradient)) == pytest.approx(0.0, abs=1e-6)
    assert twist @ gradient > 0.0


def test_slip_to_both_sides_and_sticking_occur():
    slips = {int(one_contact((-0.045, 0.02), angle, 0.3, Support((0.0, 0.0), 0.034))["slip"])
             for angle in np.linspace(-1.4, 1.4, 30)}  # fmt: skip
    assert slips == {-1, 0, 1}


def test_receding_pusher_leaves_slider_at_rest():
    for angle in (np.pi / 2 + 0.01, np.pi, -2.0):
        assert one_contact((-0.045, 0.02), angle, 0.5, Support((0.0, 0.0), 0.034))["contact"] == pytest.approx([0, 0])


@settings(max_examples=80, deadline=None)
@given(st.tuples(coordinates, coordinates), directions, supports)
def test_very_high_friction_sticks_unless_pusher_would_have_to_pull(point, angle, support):
    move = one_contact(point, angle, 1e9, support)
    lever = np.array([-move["arm"][1], move["arm"][0]]) / support.length
    to_stick = np.linalg.solve(np.eye(2) + np.outer(lever, lever), move["pusher"])
    if to_stick[0] > 1e-6:
        assert move["slip"] == 0
        assert move["contact"] == pytest.approx(move["pusher"], abs=1e-12)
    elif to_stick[0] < -1e-6:
        assert move["slip"] != 0
        assert move["force"][0] == pytest.approx(0.0, abs=1e-6)


def test_without_friction_the_force_is_along_the_normal():
    for angle in np.linspace(-1.5, 1.5, 13):
        force = one_contact((-0.045, 0.02), angle, 0.0, Support((0.0, 0.0), 0.034))["force"]
        assert force[1] == pytest.approx(0.0, abs=1e-15)
        assert force[0] > 0.0


@settings(max_examples=80, deadline=None)
@given(coordinates, directions, frictions, supports)
def test_turn_direction_follows_mason_voting_theorem(y, angle, friction, support):
    """Mason 1986: two of the push direction and the two edges of the friction cone agree on the side to turn to."""
    move = one_contact((-0.045, y), angle, friction, support)
    rays = [np.array([np.cos(angle), np.sin(angle)]), np.array([1.0, friction]), np.array([1.0, -friction])]
    moments = sorted(float(move["arm"][0] * ray[1] - move["arm"][1] * ray[0]) for ray in rays)
    if abs(moments[1]) > 1e-9:
        assert np.sign(move["spin"]) == np.sign(moments[1])


# --- supports ------------------------------------------------------------------------------------------------------


def test_uniform_pressure_of_circle_has_length_two_thirds_of_radius():
    assert uniform_support(ellipse(0.0525, 0.0525)).length == pytest.approx(2.0 / 3.0 * 0.0525, rel=1e-15)


def test_uniform_pressure_of_square_has_known_mean_distance():
    expected = 0.09 * (np.sqrt(2.0) + np.log(1.0 + np.sqrt(2.0))) / 6.0
    assert uniform_support(square(0.09)).length == pytest.approx(expected, rel=1e-14)


@EVERY_OUTLINE
def test_uniform_pressure_equals_sum_over_grid(outline):
    ticks = np.linspace(-0.10975, 0.10975, 440) + 1.3e-5  # off the edges
    points = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    inside = points[outline.project(points).distance < 0.0]
    support = uniform_support(outline)
    assert support.length == pytest.approx(np.mean(np.linalg.norm(inside, axis=1)), rel=2e-3)
    assert support.centre == pytest.approx(np.mean(inside, axis=0), abs=2e-4)


def test_uniform_pressure_of_nonconvex_outline_equals_sum_over_grid():
    ell = Outline(np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.04], [0.04, 0.04], [0.04, 0.1], [0.0, 0.1]]))
    ticks = np.linspace(0.0005, 0.0995, 100)
    points = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    points = points[(points[:, 0] < 0.04) | (points[:, 1] < 0.04)]
    support = uniform_support(ell)
    assert support.centre == pytest.approx(points.mean(axis=0), abs=1e-12)
    assert support.length == pytest.approx(np.mean(np.linalg.norm(points - support.centre, axis=1)), rel=1e-3)


def test_support_of_points_is_the_load_weighted_mean():
    support = support_of_points(np.array([[0.03, 0.0, 2.0], [-0.03, 0.0, 1.0], [-0.03, 0.0, 1.0]]))
    assert support.centre == pytest.approx((0.0, 0.0))
    assert support.length == pytest.approx(0.03)
    uneven = support_of_points(np.array([[0.04, 0.0, 0.75], [0.0, 0.0, 0.25]]))
    assert uneven.centre == pytest.approx((0.03, 0.0))
    assert uneven.length == pytest.approx(0.75 * 0.01 + 0.25 * 0.03)


# --- displacement over a window --------------------------------------------------------------------------------------


@EVERY_OUTLINE
def test_a_push_through_the_centre_along_the_normal_only_translates(outline):
    middle = 0.5 * outline.edge_starts[1] if outline.semi_axes is None else 0.25
    if outline is TRIANGLE:
        middle = 1.0 / 3.0 * outline.edge_starts[1]  # the foot of the centroid on the leg
    moved = AnalyticalPush(outline, RADIUS).displacement(np.array([[0.02, middle, 0.0]]), np.array([0.2]))
    assert moved[0] == pytest.approx([0.004, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("name", ["rect1", "ellip2", "hex"])
def test_a_mirrored_push_gives_the_mirrored_motion(name):
    model, (inputs, duration) = AnalyticalPush(OUTLINES[name], RADIUS), pushes(200)
    if name == "rect1":  # this square's mirror axis passes through the middle of edge 0, an eighth along
        mirrored = (0.25 - inputs[:, 1]) % 1.0
    else:
        mirrored = (1.0 - inputs[:, 1]) % 1.0
    other = np.column_stack([inputs[:, 0], mirrored, -inputs[:, 2]])
    here, there = model.displacement(inputs, duration), model.displacement(other, duration)
    assert there * [1.0, -1.0, -1.0] == pytest.approx(here, abs=3e-7)


@pytest.mark.parametrize("name", ["rect1", "ellip3", "hex", "ellip1"])
def test_turning_a_symmetric_slider_changes_nothing(name):
    outline = OUTLINES[name]
    model, (inputs, duration) = AnalyticalPush(outline, RADIUS), pushes(200)
    order = outline.rotational_symmetry or 7
    turned = np.column_stack([inputs[:, 0], (inputs[:, 1] + 1.0 / order) % 1.0, inputs[:, 2]])
    assert model.displacement(turned, duration) == pytest.approx(model.displacement(inputs, duration), abs=3e-7)


@EVERY_OUTLINE
def test_displacement_depends_on_the_travel_and_not_on_the_speed(outline):
    model, (inputs, duration) = AnalyticalPush(outline, RADIUS), pushes(100)
    fast = inputs * [5.0, 1.0, 1.0]
    assert model.displacement(fast, duration / 5.0) == pytest.approx(model.displacement(inputs, duration), abs=1e-7)


def test_scaling_all_lengths_scales_the_motion():
    inputs, duration = pushes(100)
    small = AnalyticalPush(square(0.09), RADIUS).displacement(inputs, duration)
    large = AnalyticalPush(square(0.18), 2 * RADIUS).displacement(inputs * [2.0, 1.0, 1.0], duration)
    assert large == pytest.approx(small * [2.0, 2.0, 1.0], abs=1e-6)


@pytest.mark.parametrize("travel", [0.004, 0.0145])
@EVERY_OUTLINE
def test_disc_ends_on_the_outline_or_outside_it(outline, travel):
    model = AnalyticalPush(outline, RADIUS)
    path = sweeps(model, *pushes(300, travel=travel))
    pose = slide(model, path)
    end = to_body(path.tip + path.travel[:, None] * path.ahead, pose)
    nearest = outline.project(end)
    gap = nearest.distance - RADIUS
    approaching = np.sum(rotate(path.ahead, -pose[:, 2]) * -nearest.normal, axis=1) > 0.02
    assert np.min(gap) > -1e-7
    assert np.max(np.abs(gap[approaching])) < 1e-6  # who has not left touches
    assert np.mean(approaching) > 0.8


def test_a_pusher_that_slides_off_leaves_the_slider_behind():
    model = AnalyticalPush(square(0.09), RADIUS, contact_friction=0.1)
    last = model.outline.contact_on_edge(0, 0.98)
    inputs = np.array([[0.02, last, -1.3]])  # edge 0 runs down the left side: to its end is to the right
    short, long = (model.displacement(inputs, np.array([t]))[0] for t in (2.0, 3.0))
    assert np.linalg.norm(short[:2]) < 0.02
    assert long == pytest.approx(short, abs=0.5 * ACCURACY * float(np.linalg.norm(short)))


@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 0.013), st.floats(-0.03, 0.03))
def test_disc_moves_slider_only_after_touch(distance, y):
    model = AnalyticalPush(square(0.09), RADIUS, 0.3, Support((0.0, 0.0), 0.034))
    start, ahead = np.array([[-0.045 - RADIUS - distance, y]]), np.array([[1.0, 0.0]])
    after_gap = slide(model, sweep(start, ahead, np.array([0.014])))
    at_once = slide(model, sweep(start + distance * ahead, ahead, np.array([0.014 - distance])))
    assert after_gap == pytest.approx(at_once, abs=5e-4 * 0.014 / LEVER)


def test_a_disc_crosses_a_notch_and_pushes_its_far_side():
    notch = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.06], [0.07, 0.06], [0.07, 0.03], [0.03, 0.03], [0.03, 0.06], [0.0, 0.06]]
    outline = Outline(np.array(notch))
    model = AnalyticalPush(outline, RADIUS, 0.3, Support((0.05, 0.05), 0.03))
    start, travel = np.array([[0.03 + RADIUS + 1e-4, 0.05]]), np.array([0.035])
    pose = slide(model, sweep(start, np.array([[1.0, 0.0]]), travel))
    assert pose[0] == pytest.approx([0.035 - (0.04 - 2 * RADIUS - 1e-4), 0.0, 0.0], abs=3e-5)


def test_pusher_that_moves_away_leaves_slider_at_rest():
    model = AnalyticalPush(square(0.09), RADIUS)
    assert np.all(model.displacement(np.array([[0.02, 0.1, 2.0]]), np.array([0.2])) == 0.0)


def test_off_centre_friction_turns_a_slider_pushed_at_its_middle():
    push, duration = np.array([[0.02, 0.125, 0.0]]), np.array([0.2])
    heavy_left = AnalyticalPush(square(0.09), RADIUS, support=Support((0.0, 0.01), 0.034))
    heavy_right = AnalyticalPush(square(0.09), RADIUS, support=Support((0.0, -0.01), 0.034))
    left, right = heavy_left.displacement(push, duration)[0], heavy_right.displacement(push, duration)[0]
    assert left[2] > 0.01  # pushed to the right of its centre of friction: counter-clockwise
    assert right == pytest.approx(left * [1.0, -1.0, -1.0], abs=1e-9)


def test_rows_do_not_depend_on_their_neighbours():
    model, (inputs, duration) = AnalyticalPush(square(0.09), RADIUS), pushes(40)
    together = model.displacement(inputs, duration)
    alone = np.vstack([model.displacement(inputs[k : k + 1], duration[k : k + 1]) for k in range(40)])
    assert np.array_equal(together, alone)


# --- convergence and cost --------------------------------------------------------------------------------------------


def in_equal_steps(model: AnalyticalPush, path: TruePush, steps: int) -> np.ndarray:
    """Poses (n, 3) by equal steps of the classical fourth-order Runge-Kutta method, while the disc touches."""
    motion, rows = Motion(model.mechanics, of(model, path), path), np.arange(len(path.travel))
    pose, step = np.zeros((len(rows), 3)), path.travel / steps
    h = step[:, None]
    for k in range(steps):
        k1, gap, *_ = motion.rate(rows, pose, k * step)
        k2, *_ = motion.rate(rows, pose + 0.5 * h * k1, (k + 0.5) * step)
        k3, *_ = motion.rate(rows, pose + 0.5 * h * k2, (k + 0.5) * step)
        k4, *_ = motion.rate(rows, pose + h * k3, (k + 1) * step)
        pose = pose + np.where((gap < 2e-5)[:, None], h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), 0.0)
    return pose


@pytest.mark.slow
@pytest.mark.parametrize(
    "outline",
    [OUTLINES["triangle"], OUTLINES["rect1"], pytest.param(OUTLINES["ellip3"], marks=pytest.mark.long)],
)
def test_displacements_are_within_a_thousandth_of_fine_steps(outline):
    model = AnalyticalPush(outline, RADIUS)
    path = sweeps(model, *pushes(40, seed=3, travel=0.0145))
    exact = in_equal_steps(model, path, 256)
    error = size(slide(model, path) - exact)
    moved = size(exact) > 0.001 * path.travel
    assert np.all(error[moved] < 1e-3 * size(exact)[moved])
    assert np.all(error[~moved] < 1e-5 * path.travel[~moved])


@pytest.mark.parametrize(
    ("contact", "angle", "travel"), [(0.2534, 0.9333, 0.02055), (0.7371, -1.1509, 0.01792), (0.7483, -1.13, 0.0192)]
)
def test_a_corner_that_only_the_last_stages_of_a_step_see_is_not_stepped_over(contact, angle, travel):
    model = AnalyticalPush(OUTLINES["rect1"], RADIUS)
    push = np.array([[travel, contact, angle]]), np.ones(1)
    path = sweeps(model, *push)
    finely = replace(model.mechanics, accuracy=3e-7).displacement({"contact_friction": model.contact_friction}, *push)
    assert np.all(np.abs(model.displacement(*push) - finely) < 1e-4 * np.linalg.norm(finely[:, :2]) / [1.0, 1.0, 0.03])
    nearest = model.outline.project(to_body(path.tip + path.travel[:, None] * path.ahead, slide(model, path)))
    assert np.all(nearest.distance - RADIUS > -1e-7)


def test_motion_is_smooth_while_contact_mode_is_constant():
    """A method of fourth order converges as such only on a rate that is."""
    model = AnalyticalPush(square(0.09), RADIUS)
    inputs = np.array([[0.02, 0.07, 0.05], [0.02, 0.11, 0.9], [0.02, 0.16, -0.8]])  # sticks, slips left, slips right
    path = sweeps(model, inputs, np.full(3, 1.0))
    exact = in_equal_steps(model, path, 128)
    errors = [size(in_equal_steps(model, path, steps) - exact) for steps in (2, 4, 8)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(orders > 3.5)


# --- fit and errors --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_fit_recovers_true_parameters():
    truth = AnalyticalPush(square(0.09), RADIUS, 0.22, Support((0.0, 0.0), 0.029))
    inputs, duration = pushes(200)
    exact = truth.displacement(inputs, duration)
    noisy = exact + np.random.default_rng(1).normal(size=exact.shape) * [1e-4, 1e-4, 3e-3]
    for outcomes, share in ((exact, 1e-3), (noisy, 0.05)):
        fitted = fit_analytical(AnalyticalPush(square(0.09), RADIUS), inputs, duration, outcomes)
        assert fitted.contact_friction == pytest.approx(0.22, rel=share)
        assert fitted.support.length == pytest.approx(0.029, rel=share)


@pytest.mark.slow
def test_fit_is_deterministic_and_keeps_other_parameters():
    start = AnalyticalPush(square(0.09), RADIUS, support=Support((0.003, 0.001), 0.03))
    inputs, duration = pushes(15, seed=1)
    outcomes = replace(start, contact_friction=0.5).displacement(inputs, duration)
    first, second = (fit_analytical(start, inputs, duration, outcomes) for _ in range(2))
    assert (first.contact_friction, first.support) == (second.contact_friction, second.support)
    assert first.support.centre == start.support.centre
    assert first.pusher_radius == start.pusher_radius


@pytest.mark.slow
def test_fit_stays_within_physical_lengths():
    inputs, duration = pushes(15, seed=1)
    pure_shift = np.column_stack([inputs[:, 0] * duration, np.zeros(15), np.zeros(15)])
    fitted = fit_analytical(AnalyticalPush(square(0.09), RADIUS), inputs, duration, pure_shift)
    assert 0.0 < fitted.support.length <= 0.045 * np.sqrt(2.0)


@pytest.mark.parametrize("outcomes", [np.zeros((3, 2)), np.zeros((2, 3)), np.full((3, 3), np.nan)])
def test_fit_rejects_unusable_rows(outcomes):
    inputs, duration = pushes(3)
    with pytest.raises(TrainingError, match="rows"):
        fit_analytical(AnalyticalPush(square(0.09), RADIUS), inputs, duration, outcomes)


def test_rejects_rig_values_out_of_range():
    for wrong in ({"pusher_radius": -0.1}, {"contact_friction": np.inf}):
        with pytest.raises(RigError, match=next(iter(wrong))):
            AnalyticalPush(**({"outline": square(0.09), "pusher_radius": RADIUS} | wrong))
    with pytest.raises(RigError, match="support"):
        Support((0.0, 0.0), 0.0)


@pytest.mark.parametrize(("column", "name"), [(0, "velocity"), (1, "contact"), (2, "angle")])
def test_rejects_nonfinite_request(column, name):
    inputs, duration = pushes(3)
    inputs[1, column] = np.nan
    with pytest.raises(RequestError, match=name):
        AnalyticalPush(square(0.09), RADIUS).displacement(inputs, duration)


def test_the_support_of_a_moved_ellipse_moves_with_it() -> None:
    own, pose = ellipse(0.0785, 0.0525), (0.01, -0.02, 0.4)
    moved = transformed(own, pose[2], pose[:2])
    support = uniform_support(moved)
    assert support.centre == pytest.approx(pose[:2])
    assert support.length == pytest.approx(uniform_support(own).length)
    expected = rotate(patch(own).points, np.array(pose[2])) + pose[:2]
    np.testing.assert_allclose(patch(moved).points, expected, atol=1e-15)


# --- several models at once -------------------------------------------------------------------------------


@EVERY_OUTLINE
def test_models_that_differ_in_friction_and_support_are_computed_together_as_each_alone(outline: Outline) -> None:
    model, (inputs, duration) = AnalyticalPush(outline, RADIUS, 0.25), pushes(20, seed=4)
    (x, y), length = model.support.centre, model.support.length
    others = [
        replace(model, contact_friction=0.5),
        replace(model, support=Support((x + 0.004, y), 0.9 * length)),
        replace(model, contact_friction=0.0, support=Support((x, y - 0.003), 1.2 * length)),
    ]
    alone = [other.displacement(inputs, duration) for other in others]
    np.testing.assert_allclose(model.displacements(others, inputs, duration), alone, atol=1e-9)


def test_pushes_of_several_models_are_rejected_by_name_too() -> None:
    model = AnalyticalPush(square(0.09), RADIUS)
    with pytest.raises(RequestError, match="velocity"):
        model.displacements([model], np.array([[-0.1, 0.1, 0.1]]), np.array([0.2]))
