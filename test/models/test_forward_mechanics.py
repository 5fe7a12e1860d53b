"""The forward model obeys its own physics: symmetries, limits, and the meaning of each of its parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from supports import FOUR_POINTS, THREE_POINTS

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import SHAPES, ellipse, shape_outline, square
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.forward import EXPONENT_KNOTS, PushMechanics
from push_predictor.models.mechanics.limit_surface import uniform_support
from push_predictor.models.mechanics.limit_surfaces.load_map import load_map
from push_predictor.models.mechanics.limit_surfaces.loaded_surface import LoadedSurface
from push_predictor.models.mechanics.limit_surfaces.point_friction import load_of_twist
from push_predictor.models.mechanics.limit_surfaces.support_surfaces import row_surfaces
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.models.mechanics.motion.sweep import swept
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS, MechanicsParameter
from push_predictor.models.mechanics.pressure import PressureDistribution, patch
from push_predictor.models.mechanisms import LIBRARY, Push
from push_predictor.types import Array, IntArray

RADIUS = 0.00475
IN_METRES = np.array([1.0, 1.0, 0.034])
SQUARE = square(0.09)


def ellipsoid(outline: Outline) -> PowerSurface:
    support = uniform_support(outline)
    return PowerSurface(np.array(support.centre), support.length)


@cache
def mechanics(shape: str = "rect1", kind: str = "patch") -> PushMechanics:
    """Kept for all tests: a table takes some tenths of a second."""
    outline = shape_outline(shape)
    kinds = {"patch": None, "three": THREE_POINTS, "four": FOUR_POINTS, "ellipsoid": ellipsoid(outline)}
    return PushMechanics(outline, RADIUS, kinds[kind])


def pushes(n: int, seed: int = 0, travel: float = 0.004, speed: float = 0.02) -> tuple[Array, Array]:
    draw = np.random.default_rng(seed)
    inputs = np.column_stack([np.full(n, speed), draw.random(n), draw.uniform(-1.3, 1.3, n)])
    return inputs, np.full(n, travel / speed)


def moved(
    model: PushMechanics,
    values: Mapping[str, float | Array],
    inputs: Array,
    duration: Array,
    heading: Array | float = 0.0,
) -> Array:
    """Displacements of pushes along a heading in the world."""
    return model.displacement(values, inputs, duration, {"push_heading": np.broadcast_to(heading, len(inputs))})


def one(contact: float = 0.125, angle: float = 0.0, travel: float = 0.004) -> tuple[Array, Array]:
    return np.array([[0.02, contact, angle]]), np.array([travel / 0.02])


def size(displacement: Array) -> Array:
    return np.asarray(np.linalg.norm(displacement * IN_METRES, axis=-1))


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


@pytest.mark.parametrize("kind", ["patch", "three"])
@pytest.mark.parametrize("travel", [0.004, 0.02])
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


# --- every parameter has the effect that its meaning states ---------------------------------------------------------


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


def test_pressure_at_the_rim_resists_turning() -> None:
    push = one(0.05, 0.0)
    turn = moved(mechanics(), {}, *push)[0, 2]
    assert np.sign(change("rim_exponent", 4.0, push)[2]) == -np.sign(turn)
    assert np.sign(change("rim_exponent", -2.0, push)[2]) == np.sign(turn)


def test_pressure_to_the_left_of_a_push_turns_the_slider_clockwise_about_it() -> None:
    # Edge 0 is the left side: the push runs along body x, so body y is to its left.
    assert change("centre_y", 0.005, one())[2] > 0.0  # the tip passes on the right of the centre: counter-clockwise
    assert change("centre_x", 0.005, one()) == pytest.approx(0.0, abs=1e-6)
    turn = moved(mechanics(), {}, *one(0.05))[0, 2]
    ahead = change("centre_x", 0.01, one(0.05))[2]  # a longer arm along the push makes it turn less
    assert np.sign(ahead) == -np.sign(turn)


def test_push_above_the_table_shifts_the_centre_ahead() -> None:
    push = one(0.06, 0.1)
    raised, ahead = change("pushing_height", 0.001, push), change("centre_x", 0.001, push)
    assert raised @ ahead > 0.0
    assert change("pushing_height", 0.005, one()) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("name", ["body_anisotropy", "grain_x"])
def test_slider_gives_way_along_the_direction_in_which_it_slides_easily(name: str) -> None:
    """The tip sticks on the left side off the middle, at an angle to body x: motion along x is easy, along y hard."""
    ahead = [
        rotate(moved(mechanics(), {"contact_friction": 2.0, name: v}, *one(0.2, 0.2), 0.2)[:, :2], np.array([0.2]))[
            0, 0
        ]
        for v in (0.2, 0.0)
    ]
    assert ahead[0] > ahead[1] + 1e-5


def test_grain_is_body_anisotropy_of_a_slider_at_the_worlds_heading() -> None:
    inputs, duration = pushes(10, travel=5e-4)
    body = moved(mechanics(), {"body_anisotropy": 0.2}, inputs, duration)
    along = SQUARE.inward_normal(inputs[:, 1])
    in_body = np.arctan2(along[:, 1], along[:, 0]) + inputs[:, 2]
    world = moved(mechanics(), {"grain_x": 0.2}, inputs, duration, in_body)  # a slider that stands at zero heading
    assert world == pytest.approx(body, rel=2e-3, abs=1e-6)
    turned = moved(mechanics(), {"grain_diagonal": 0.2}, inputs, duration, in_body + np.pi / 4.0)
    assert turned == pytest.approx(body, rel=2e-3, abs=1e-6)


def test_slope_pulls_the_slider_its_way() -> None:
    inputs, duration = one(0.125, 0.0)
    for heading, name in ((0.0, "slope_y"), (-np.pi / 2.0, "slope_x")):  # both pull to the left of the push
        left = moved(mechanics(), {name: 0.2}, inputs, duration, heading)[0]
        assert left[1] > 1e-5
    ahead = moved(mechanics(), {"slope_x": 0.2}, inputs, duration, 0.0)[0]
    assert ahead == pytest.approx([0.004, 0.0, 0.0], abs=2e-6)


def test_friction_that_grows_to_the_left_is_a_centre_to_the_left() -> None:
    square_of_pressure = 0.09**2 / 12.0
    expected = change("centre_y", 2.0 * square_of_pressure, one())
    assert change("gradient_y", 2.0, one()) == pytest.approx(expected, rel=0.01)
    assert change("gradient_x", 2.0, one(), -np.pi / 2.0) == pytest.approx(expected, rel=0.01)


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
    (inputs, duration), shift = pushes(20, speed=0.2), np.array([0.01, -0.006])
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


def test_a_disc_that_is_apart_moves_the_slider_from_its_touch_on() -> None:
    def rate(rows: IntArray, pose: Array, done: Array) -> tuple[Array, Array, Array]:
        push = np.tile([1.0, 0.0, 0.0], (len(rows), 1))
        return push, np.array([0.0033, 0.0])[rows] - done + pose[:, 0], np.ones(len(rows))

    pose = swept(rate, np.array([0.0075, 0.0075]), np.full(2, 0.03), 1e-3)
    assert pose[:, 0] == pytest.approx([0.0075 - 0.0033, 0.0075], abs=2.1e-5)


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


PART_OF = {
    "contact_friction": ("contact_friction", 0),
    "centre_x": ("centre_of_friction", 0),
    "centre_y": ("centre_of_friction", 1),
    "pushing_height": ("pushing_height", 0),
    "body_anisotropy": ("body_anisotropy", 0),
    "body_anisotropy_diagonal": ("body_anisotropy", 1),
    "grain_x": ("anisotropic_friction", 0),
    "grain_diagonal": ("anisotropic_friction", 1),
    "gradient_x": ("friction_gradient", 0),
    "gradient_y": ("friction_gradient", 1),
    "slope_x": ("tilted_surface", 0),
    "slope_y": ("tilted_surface", 1),
    "inertia": ("inertia", 0),
    "radius_error": ("pusher_radius", 0),
    "travel_share": ("pusher_travel", 0),
    "friction_difference": ("contact_asymmetry", 0),
}


@pytest.mark.parametrize("name", PART_OF)
def test_small_change_is_the_response_of_the_mechanism(name: str) -> None:
    outline, n, draw = shape_outline("ellip3"), 30, np.random.default_rng(2)
    inputs = np.column_stack([draw.uniform(0.02, 0.1, n), draw.random(n), draw.uniform(-1.0, 1.0, n)])
    duration, heading, normal = np.full(n, 0.05), draw.uniform(-3.0, 3.0, n), outline.inward_normal(inputs[:, 1])
    slider = heading - np.arctan2(normal[:, 1], normal[:, 0]) - inputs[:, 2]
    mechanism, column = PART_OF[name]
    response = {m.name: m for m in LIBRARY}[mechanism].response(
        AnalyticalPush(outline, RADIUS), Push(inputs, duration, {"slider_heading": slider})
    )[:, :, column]
    model, base = replace(mechanics("ellip3", "ellipsoid"), accuracy=1e-5), BY_NAME[name].textbook
    step = {"contact_friction": 0.1, "gradient_x": 2.0, "gradient_y": 2.0, "inertia": 0.02}.get(name)
    step = step or 0.5 * BY_NAME[name].spread
    more, less = (moved(model, {name: base + s}, inputs, duration, heading) for s in (step, -step))
    left = size((more - less) / (2.0 * step) - response)
    # The mechanism changes friction where the base model slips; a change also moves the begin of slip.
    allowed = 0.3 if name == "friction_difference" else 0.05
    assert np.sqrt(np.mean(left**2) / np.mean(size(response) ** 2)) < allowed


# --- large effects are exact, not first order ----------------------------------------------------------------------


@pytest.mark.parametrize("stretch", [(0.3, 0.0), (0.75, 0.0), (-0.2, 0.4)])
@pytest.mark.parametrize("kind", ["patch", "three"])
def test_stretched_surface_is_near_the_sum_of_direction_dependent_point_frictions(
    kind: str, stretch: tuple[float, float]
) -> None:
    """A point at velocity u resists with W^-1 u / sqrt(u' W^-1 u)."""
    support = patch(SQUARE) if kind == "patch" else THREE_POINTS
    surface, points = load_map(support), support.points - support.centre
    a, b = stretch
    inverse = np.linalg.inv(np.array([[1.0 + a, b], [b, 1.0 - a]]))
    draw = np.random.default_rng(0).standard_normal((300, 3)) / [1.0, 1.0, surface.length]
    u = draw[:, None, :2] + draw[:, None, 2:] * np.column_stack([-points[:, 1], points[:, 0]])
    resisted = u @ inverse
    f = support.shares[:, None] * resisted / np.sqrt(np.sum(u * resisted, axis=2))[:, :, None]
    moment = np.sum(points[:, 0] * f[:, :, 1] - points[:, 1] * f[:, :, 0], axis=1) / surface.length
    rows, zero = np.arange(300), np.zeros(300, dtype=np.int64)
    loaded = LoadedSurface(row_surfaces([surface], zero, zero, np.zeros(300)), rows, stretch=np.tile(stretch, (300, 1)))
    found = np.stack(loaded.twist(slice(None), *f.sum(axis=1).T, moment), axis=1)
    wanted = draw * [1.0, 1.0, surface.length]
    plain = np.stack(surface.twist(*f.sum(axis=1).T, moment), axis=1)
    share = {"patch": 0.3, "three": 0.5}[kind]  # three points keep their place on the table, not their flats
    assert np.mean(_angle(found, wanted)) < share * np.mean(_angle(plain, wanted))


def test_pull_lies_with_the_pushers_load_on_the_limit_surface() -> None:
    surface, n, draw = load_map(THREE_POINTS), 200, np.random.default_rng(1)
    pull = draw.uniform(-0.3, 0.3, (n, 3))
    rows, zero = np.arange(n), np.zeros(n, dtype=np.int64)
    loaded = LoadedSurface(row_surfaces([surface], zero, zero, np.zeros(n)), rows, pull=pull)
    pusher = draw.standard_normal((n, 3))
    factor, load = loaded.on_surface(slice(None), tuple(pusher.T))
    on_surface = np.stack(load, axis=1) / np.linalg.norm(pusher, axis=1)[:, None]
    assert surface.gauge(*on_surface.T) == pytest.approx(1.0, abs=0.02)
    assert np.mean(np.abs(surface.gauge(*on_surface.T) - 1.0)) < 1e-3
    assert on_surface - pull == pytest.approx(factor[:, None] * pusher, abs=1e-9)


def _angle(one: Array, other: Array) -> Array:
    one, other = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (one, other))
    return np.asarray(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=1), 0.0, 1.0)))


def test_load_of_twist_agrees_with_stretch_of_zero() -> None:
    surface, zero = load_map(THREE_POINTS), np.zeros(5, dtype=np.int64)
    loaded = LoadedSurface(row_surfaces([surface], zero, zero, np.zeros(5)), np.arange(5), stretch=np.zeros((5, 2)))
    load = load_of_twist(THREE_POINTS, np.random.default_rng(0).standard_normal((5, 3)))
    assert np.stack(loaded.twist(slice(None), *load.T)) == pytest.approx(np.stack(surface.twist(*load.T)))


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
    thick = PushMechanics(SQUARE, RADIUS + 0.003, mechanics().support, _tables=mechanics()._tables)
    assert moved(mechanics(), {"radius_error": 0.003}, inputs, duration) == pytest.approx(
        moved(thick, {}, inputs, duration), abs=1e-9
    )


def test_patch_of_a_circle_does_not_turn_without_contact_friction() -> None:
    circle = PushMechanics(ellipse(0.05, 0.05), RADIUS)
    inputs, duration = pushes(10)
    assert circle.displacement({"contact_friction": 0.0}, inputs, duration)[:, 2] == pytest.approx(0.0, abs=1e-4)
