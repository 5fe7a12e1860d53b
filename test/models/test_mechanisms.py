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

"""Mechanisms: the response of an outcome to each parameter, checked against mechanics solved by other methods."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms.perturbed import Change, State, displaced, no_change
from repository import REPOSITORY
from scipy.optimize import fsolve

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import mechanics_of
from push_predictor.models.mechanics.parameters import BY_NAME as PARAMETERS_BY_NAME
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS, Mechanism, Push
from push_predictor.recordings.table import PushTable
from push_predictor.simulation.rig_simulator import SimulationSpec, push_outcomes, random_pushes

BY_NAME = {mechanism.name: mechanism for mechanism in LIBRARY}
TRIANGLE = Outline(np.array([[-0.05, -0.05], [0.10, -0.05], [-0.05, 0.10]]))
OUTLINES = {name: shape_outline(name) for name in ("rect1", "ellip1", "ellip2", "ellip3", "hex")} | {"tri": TRIANGLE}
IN_METRES = np.array([1.0, 1.0, 0.04])  # a turn counts as the path of a point 4 cm from the centre

# Under a reflection of body, table and push in the body's x axis each parameter keeps its sign (1) or changes it (-1).
MIRRORED = {
    "contact_friction": [1],
    "contact_asymmetry": [-1],
    "pressure_spread": [1],
    "centre_of_friction": [1, -1],
    "pushing_height": [1],
    "limit_surface_power": [1],
    "body_anisotropy": [1, -1],
    "anisotropic_friction": [1, -1],
    "friction_gradient": [1, -1],
    "tilted_surface": [1, -1],
    "inertia": [1],
    "pusher_radius": [1],
    "pusher_travel": [1],
}
FIXED_TO_THE_BODY = ("centre_of_friction", "body_anisotropy")


def physics_of(outline: str, friction: float = 0.25) -> AnalyticalPush:
    return AnalyticalPush(OUTLINES[outline], 0.00475, friction)


def pushes(n: int, seed: int = 0, duration: float = 0.2) -> Push:
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(0.02, 0.1, n), rng.random(n), rng.uniform(-1.0, 1.0, n)])
    return Push(inputs, np.full(n, duration), {"slider_heading": rng.uniform(-3.0, 3.0, n)})


def altered(push: Push, contact: np.ndarray | None = None, angle: float = 1.0, turn: float = 0.0) -> Push:
    """The pushes at other contacts, with angles (and headings) times `angle`, sliders turned by `turn`."""
    velocity, old, beta = push.inputs.T
    heading = angle * push.covariates["slider_heading"] + turn
    inputs = np.column_stack([velocity, old if contact is None else contact, angle * beta])
    return Push(inputs, push.duration, {"slider_heading": heading})


def size(response: np.ndarray) -> np.ndarray:
    """Root mean square (p,) over windows and outputs."""
    return np.sqrt(np.mean((response * IN_METRES[None, :, None]) ** 2, axis=(0, 1)))


def share_explained(difference: np.ndarray, response: np.ndarray) -> tuple[float, float]:
    """R^2 of a difference (n, 3) by a response (n, 3, 1), and the coefficient."""
    y, x = (difference * IN_METRES).ravel(), (response[:, :, 0] * IN_METRES).ravel()
    coefficient = float(x @ y / (x @ x))
    return 1.0 - float(np.sum((y - coefficient * x) ** 2) / np.sum(y**2)), coefficient


# --- every mechanism on every outline -------------------------------------------------------------------------------


@pytest.mark.parametrize("outline", ["ellip1", "ellip3", "tri"])
@pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda m: m.name)
def test_response_has_a_finite_nonzero_column_per_parameter(mechanism: Mechanism, outline: str) -> None:
    response = mechanism.response(physics_of(outline), pushes(30))
    assert response.shape == (30, 3, len(mechanism.parameters))
    assert np.all(np.isfinite(response))
    assert np.all(size(response) * [p.largest for p in mechanism.parameters] > 1e-5)


def test_no_two_mechanisms_share_a_name_and_every_parameter_has_a_unit_and_a_limit() -> None:
    assert len(BY_NAME) == len(LIBRARY) == len(MIRRORED)
    assert all(p.unit and 0.0 < p.largest < np.inf for m in LIBRARY for p in m.parameters)


@pytest.mark.parametrize("mechanism", LIBRARY, ids=lambda m: m.name)
def test_a_mirrored_push_has_the_mirrored_response(mechanism: Mechanism) -> None:
    push = pushes(40)
    contact = np.random.default_rng(1).uniform(0.001, 0.249, 40)  # on the side that the x axis cuts in half
    here = mechanism.response(physics_of("rect1"), altered(push, contact))
    there = mechanism.response(physics_of("rect1"), altered(push, 0.25 - contact, angle=-1.0))
    expected = here * np.array([1.0, -1.0, -1.0])[None, :, None] * np.array(MIRRORED[mechanism.name])
    assert np.all(size(there - expected) < 2e-3 * size(here))


@pytest.mark.parametrize(("outline", "order"), [("hex", 6), ("ellip2", 2)])
@pytest.mark.parametrize("mechanism", [m for m in LIBRARY if m.name not in FIXED_TO_THE_BODY], ids=lambda m: m.name)
def test_response_is_the_same_on_equivalent_sides(mechanism: Mechanism, outline: str, order: int) -> None:
    push = pushes(30)
    contact = np.random.default_rng(1).uniform(0.001, 1.0 / order - 0.001, 30)
    here = mechanism.response(physics_of(outline), altered(push, contact))
    turned = altered(push, contact + 1.0 / order, turn=-2.0 * np.pi / order)
    there = mechanism.response(physics_of(outline), turned)
    assert np.all(size(there - here) < 2e-3 * size(here))


@pytest.mark.parametrize(("name", "sign"), [("anisotropic_friction", 1), ("tilted_surface", -1), ("inertia", 1)])
def test_anisotropy_is_even_and_slope_odd_under_half_a_turn(name: str, sign: int) -> None:
    push = pushes(40)
    here, there = (BY_NAME[name].response(physics_of("hex"), p) for p in (push, altered(push, turn=np.pi)))
    assert there == pytest.approx(sign * here, abs=1e-9)


# --- whole pushes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("outline", ["rect1", "ellip3", "tri"])
@pytest.mark.parametrize("duration", [0.2, 1.0])
def test_the_perturbed_push_without_a_change_is_the_analytical_push(outline: str, duration: float) -> None:
    physics, push = physics_of(outline), pushes(150, duration=duration)
    expected = physics.displacement(push.inputs, push.duration)
    error = displaced(physics, push, [(lambda state, amount: no_change(len(expected)), 0.0)])[0] - expected
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < 0.01 * np.sqrt(np.mean(expected**2, axis=0)))


def test_changes_are_computed_together_as_each_alone() -> None:
    physics, push = physics_of("rect1"), pushes(20)

    def shifted(state: State, amount: float) -> Change:
        return replace(no_change(20), centre=amount * state.load[:, :2])

    def pulled(state: State, amount: float) -> Change:
        return replace(no_change(20), pull=amount * state.bend)

    tried = [(shifted, 0.002), (pulled, 0.05), (shifted, -0.001)]
    alone = [displaced(physics, push, [each])[0] for each in tried]
    np.testing.assert_allclose(displaced(physics, push, tried), alone, atol=1e-12)


@pytest.mark.parametrize("mechanism", [m for m in REFINEMENTS if len(m.parameters) > 1], ids=lambda m: m.name)
def test_a_refinement_responds_to_each_of_its_parameters(mechanism: Mechanism) -> None:
    physics, push = physics_of("rect1"), pushes(20)
    fitted, response = mechanics_of(physics), mechanism.response(physics, push)
    for k, name in enumerate(mechanism.quantities):
        size = 0.5 * PARAMETERS_BY_NAME[name].spread
        more, less = (
            fitted.displacement(push.inputs, push.duration, push.covariates, {name: np.full(20, end)})
            for end in (size, -size)
        )
        np.testing.assert_allclose(response[:, :, k], (more - less) / (2.0 * size), rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_responses_grow_with_path_length() -> None:
    for mechanism in LIBRARY:
        short, long = (mechanism.response(physics_of("tri"), pushes(15, duration=t)) for t in (0.2, 0.5))
        assert np.all(np.isfinite(long))
        assert np.all(size(long) > size(short))


def test_the_parameters_add_up_to_a_finite_change_of_the_model() -> None:
    physics, push = physics_of("ellip2"), pushes(200)
    support = physics.support
    moved = replace(physics, support=replace(support, centre=(0.0002, -0.0004), length=support.length * 1.01))
    difference = moved.displacement(push.inputs, push.duration) - physics.displacement(push.inputs, push.duration)
    shift = BY_NAME["centre_of_friction"].response(physics, push) @ [0.0002, -0.0004]
    spread = BY_NAME["pressure_spread"].response(physics, push) @ [np.log(1.01)]
    left = difference - shift - spread
    assert np.sum((left * IN_METRES) ** 2) < 0.01 * np.sum((difference * IN_METRES) ** 2)


# --- responses that must be zero -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["contact_friction", "contact_asymmetry"])
def test_contact_friction_has_no_response_where_contact_sticks(name: str) -> None:
    straight = Push(np.array([[0.02, 0.125, angle] for angle in (-0.1, -0.05, 0.0, 0.05, 0.1)]), np.full(5, 0.2), {})
    assert BY_NAME[name].response(physics_of("rect1"), straight) == pytest.approx(0.0, abs=1e-5)


def test_contact_friction_has_a_response_where_contact_slips() -> None:
    slipping = Push(np.array([[0.02, 0.125, 1.0], [0.02, 0.125, -1.0]]), np.full(2, 0.2), {})
    symmetric = BY_NAME["contact_friction"].response(physics_of("rect1"), slipping)
    lopsided = BY_NAME["contact_asymmetry"].response(physics_of("rect1"), slipping)
    assert np.all(size(symmetric) > 1e-3)
    assert lopsided[0] == pytest.approx(symmetric[0], rel=0.1, abs=1e-4)
    assert lopsided[1] == pytest.approx(-symmetric[1], rel=0.1, abs=1e-4)


@pytest.mark.parametrize("name", ["limit_surface_power", "pressure_spread", "pushing_height"])
def test_push_through_the_centre_does_not_turn_the_slider(name: str) -> None:
    through = Push(np.array([[0.02, 0.125, 0.0]]), np.full(1, 0.2), {})
    assert BY_NAME[name].response(physics_of("rect1"), through) == pytest.approx(0.0, abs=1e-6)


def test_inertia_grows_with_squared_speed_for_equal_path_length() -> None:
    slow = pushes(50)
    fast = Push(slow.inputs * [3.0, 1.0, 1.0], slow.duration / 3.0, slow.covariates)
    once, nine = (BY_NAME["inertia"].response(physics_of("ellip1", 2.0), push) for push in (slow, fast))
    left = (nine - 9.0 * once) * IN_METRES[None, :, None]
    assert np.sqrt(np.mean(left**2)) < 0.02 * size(nine)[0]


def test_a_plausible_parameter_lies_within_the_limit() -> None:
    inertia = BY_NAME["inertia"]
    assert inertia.plausible(np.array([[0.4], [0.8]]))
    assert not inertia.plausible(np.array([[0.4], [-61.0]]))


# --- against the limit surface solved directly --------------------------------------------------------------------


class Surface:
    """One sticking push at an instant: force, moment and speed found by root finding on the limit surface itself."""

    def __init__(self, physics: AnalyticalPush, contact: float, angle: float) -> None:
        outline, at = physics.outline, np.array([contact])
        self.length = physics.support.length
        self.normal, self.point = outline.inward_normal(at)[0], outline.point(at)[0]
        self.ahead = rotate(self.normal, np.array(angle))

    def twist(
        self,
        stretch: tuple[float, float] = (0.0, 0.0),
        pull: tuple[float, float] = (0.0, 0.0),
        power: float = 2.0,
        height: float = 0.0,
    ) -> np.ndarray:
        """Twist (3,) of the body's origin in the push frame, per metre of the tip's path."""
        a, b = stretch
        mobility = np.array([[1.0 + a, b], [b, 1.0 - a]])

        def motion(unknown: np.ndarray) -> tuple[np.ndarray, float]:
            force, k = unknown[:2], unknown[2]
            total = force + pull
            centre = height * force
            arm = self.point - centre
            moment = (arm[0] * force[1] - arm[1] * force[0]) / self.length
            metric = np.sqrt(total @ mobility @ total)
            along = metric ** (power - 2.0) * mobility @ total
            spin = k * np.sign(moment) * np.abs(moment) ** (power - 1.0) / self.length
            linear = k * along + spin * np.array([centre[1], -centre[0]])
            return np.array([*linear, spin]), metric**power + np.abs(moment) ** power - 1.0

        def rest(unknown: np.ndarray) -> np.ndarray:
            (vx, vy, spin), off = motion(unknown)
            touch = np.array([vx - spin * self.point[1], vy + spin * self.point[0]])
            return np.array([*(touch - self.ahead), off])

        found, _, fine, message = fsolve(rest, [*(0.7 * self.ahead), 1.0], full_output=True, xtol=1e-12)
        assert fine == 1, message
        vx, vy, spin = motion(found)[0]
        heading = np.arctan2(self.ahead[1], self.ahead[0])
        return np.array([*rotate(np.array([vx, vy]), np.array(-heading)), spin])


STICKING = 5.0  # contact friction
INSTANT = 1e-4  # m


@pytest.mark.parametrize(("contact", "angle"), [(0.05, 0.3), (0.09, -0.4), (0.21, 0.2), (0.6, -0.3)])
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("body_anisotropy", [("stretch", (1.0, 0.0)), ("stretch", (0.0, 1.0))]),
        ("anisotropic_friction", [("stretch", (1.0, 0.0)), ("stretch", (0.0, 1.0))]),
        ("tilted_surface", [("pull", (1.0, 0.0)), ("pull", (0.0, 1.0))]),
        ("pushing_height", [("height", 1.0)]),
        ("limit_surface_power", [("power", 1.0)]),
    ],
)
def test_a_response_is_the_derivative_of_the_surface_solved_by_root_finding(
    name: str, settings: list[tuple[str, Any]], contact: float, angle: float
) -> None:
    physics = physics_of("rect1", STICKING)
    surface = Surface(physics, contact, angle)
    push = Push(np.array([[0.02, contact, angle]]), np.array([INSTANT / 0.02]), {"slider_heading": np.zeros(1)})
    response = BY_NAME[name].response(physics, push)[0] / INSTANT
    amount = 1e-4
    for column, (key, direction) in enumerate(settings):
        base = 2.0 if key == "power" else 0.0
        settled: list[dict[str, Any]] = [{key: base + s * np.asarray(direction)} for s in (amount, -amount)]
        more, less = (surface.twist(**setting) for setting in settled)
        expected = (more - less) / (2.0 * amount)
        assert response[:, column] == pytest.approx(expected, rel=0.02, abs=0.01 * np.abs(expected).max())


def test_a_friction_gradient_shifts_the_centre_of_friction_of_a_slider_to_the_rougher_side() -> None:
    """Friction that rises by s per metre has its centre s a^2 / 12 from the middle of a square of uniform pressure."""
    physics, push = physics_of("rect1"), pushes(40)
    level = replace(push, covariates={"slider_heading": np.zeros(40)})
    gradient = BY_NAME["friction_gradient"].response(physics, level)
    shift = BY_NAME["centre_of_friction"].response(physics, level)
    assert np.all(size(gradient - shift * 0.09**2 / 12.0) < 0.1 * size(gradient))


# --- against the rig simulator, which has Newton's and Coulomb's laws but no limit surface ---------------------------


@pytest.mark.slow
def test_a_change_of_contact_friction_in_the_simulator_is_spanned_by_the_response_to_it() -> None:
    before, after = (_first_windows("delrin", 0.02, friction) for friction in (0.25, 0.3))
    both = np.intersect1d(before.push_id, after.push_id)
    before, after = (table.take(np.searchsorted(table.push_id, both)) for table in (before, after))
    difference = after.outcomes - before.outcomes
    push = Push(before.inputs, before.duration, {"slider_heading": np.zeros(len(before))})
    explained = {
        m.name: share_explained(difference, m.response(physics_of("rect1"), push))
        for m in LIBRARY
        if len(m.parameters) == 1
    }
    share, coefficient = explained.pop("contact_friction")
    assert share > 0.7
    assert coefficient == pytest.approx(0.05, rel=0.15)
    assert max(other for other, _ in explained.values()) < share - 0.1


def _first_windows(surface: str, speed: float, friction: float) -> PushTable:
    plan = random_pushes(80, (speed,), travel=0.005, rng=np.random.default_rng(3))
    table = push_outcomes(SimulationSpec("rect1", surface, plan, contact_friction=friction))
    return table.take(np.unique(table.push_id, return_index=True)[1])


# --- the worked example of docs/how_to/new_mechanism.md -------------------------------------------------------------


def test_the_worked_example_of_the_docs_is_a_mechanism() -> None:
    text = (REPOSITORY / "docs" / "how_to" / "new_mechanism.md").read_text()
    space: dict[str, Any] = {}
    exec(text.split("```python\n", 1)[1].split("```", 1)[0], space)
    cable: Mechanism = space["TWISTING_CABLE"]
    through = Push(np.array([[0.02, 0.125, 0.0]]), np.full(1, 0.2), {})
    turned = cable.response(physics_of("rect1", STICKING), through)[0, 2, 0]
    assert turned > 0.01  # a push straight through the centre turns in the direction in which the cable twists


def test_the_docs_name_every_mechanism_with_its_limit() -> None:
    text = (REPOSITORY / "docs" / "reference" / "trace.md").read_text()
    rows = {row.split("|")[1].strip(" `"): row.split("|") for row in text.splitlines() if row.startswith("| `")}
    every = (*LIBRARY, *REFINEMENTS)
    assert [float(rows[m.name][3]) for m in every] == [m.parameters[0].largest for m in every]
