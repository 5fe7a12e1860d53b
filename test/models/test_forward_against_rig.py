# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forward model agrees with the rig simulator, which has Newton's and Coulomb's laws but no limit surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from even_physics import no_noise, uniform_field
from supports import THREE_POINTS

from push_predictor.geometry.frames import rotate
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.models.mechanics.surface import PowerSurface
from push_predictor.simulation.changes import PLAIN, Changes
from push_predictor.simulation.dynamics import run, steps_of
from push_predictor.simulation.physics import GRAVITY, Physics
from push_predictor.simulation.pushes import PushPlan, pusher_path
from push_predictor.simulation.slider import slider_named
from push_predictor.simulation.surface import CELL, HALF_EXTENT, FrictionField
from push_predictor.types import Array

SPEED, TRAVEL, RADIUS, FRICTION = 0.005, 0.008, 0.00475, 0.3
SLIDER = slider_named("rect1")
OUTLINE = SLIDER.outline
IN_METRES = np.array([1.0, 1.0, 0.034])
N = 24
TABLE = 0.25  # friction
WEIGHT = TABLE * SLIDER.mass * GRAVITY  # N: the largest friction force
RIM = PressureDistribution(OUTLINE.point((np.arange(40) + 0.5) / 40.0), np.full(40, 1.0 / 40.0))
SUPPORTS = {"three points": THREE_POINTS, "rim": RIM}


def plan(n: int) -> PushPlan:
    """Pushes off the corners, in which the tip sticks and slips to both sides."""
    draw = np.random.default_rng(5)
    contact = OUTLINE.contact_on_edge(draw.integers(0, 4, n), draw.uniform(0.15, 0.85, n))
    return PushPlan(contact, draw.uniform(-1.0, 1.0, n), np.full(n, SPEED), np.full(n, TRAVEL))


def simulated(
    support: PressureDistribution, pushes: PushPlan, changes: Changes = PLAIN, table: FrictionField | None = None
) -> Array:
    """Displacements (n, 3) in the push frame when the tips have stopped."""
    n, k = len(pushes), len(support.points)
    physics = Physics(
        outline=OUTLINE,
        radius=RADIUS,
        mass=np.full(n, SLIDER.mass),
        inertia=np.full(n, SLIDER.inertia),
        support=support.points,
        shares=np.tile(support.shares, (n, 1)),
        contact_friction=np.full(n, FRICTION),
        surface=uniform_field(TABLE) if table is None else table,
        load_noise=no_noise(n, k),
        contact_noise=no_noise(n, 1),
        changes=changes,
    )
    path = pusher_path(pushes, OUTLINE, RADIUS, np.zeros((n, 3)), acceleration=2.5)
    # Three times the usual steps leave the errors as they are, to a fiftieth.
    pose = run(physics, path, np.zeros((n, 3)), path.push_time, time_step=3.0 * steps_of(path)).slider[:, -1]
    heading = np.arctan2(path.direction[:, 1], path.direction[:, 0])
    return np.column_stack([rotate(pose[:, :2], -heading), pose[:, 2]])


@cache
def mechanics(support: PressureDistribution | PowerSurface) -> PushMechanics:
    """Kept for all tests: a table takes a tenth of a second."""
    return PushMechanics(OUTLINE, RADIUS, support)


def predicted(
    support: PressureDistribution | PowerSurface, pushes: PushPlan, values: dict[str, float] | None = None
) -> Array:
    inputs = np.column_stack([pushes.speed, pushes.contact, pushes.angle])
    normal = OUTLINE.inward_normal(pushes.contact)
    heading = {"push_heading": np.arctan2(normal[:, 1], normal[:, 0]) + pushes.angle}
    return mechanics(support).displacement(values or {}, inputs, pushes.travel / pushes.speed, heading)


def relative_error(found: Array, truth: Array) -> float:
    """Root mean square of the error over that of the truth, in metres."""
    return float(np.sqrt(np.sum(((found - truth) * IN_METRES) ** 2) / np.sum((truth * IN_METRES) ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize("name", SUPPORTS)
def test_slow_pushes_in_the_simulator_move_as_predicted(name: str) -> None:
    support, pushes = SUPPORTS[name], plan(N)
    truth = simulated(support, pushes)
    ellipsoid = PowerSurface(support.centre, support.length)
    exact, approximate = (relative_error(predicted(s, pushes), truth) for s in (support, ellipsoid))
    assert exact < 0.015
    assert approximate > 3.0 * exact


@dataclass(frozen=True)
class Effect:
    """A value of a parameter; in the simulator a grain of the slider or of the table, or a pull on the slider."""

    value: float
    of_slider: tuple[float, float] = (0.0, 0.0)
    of_table: tuple[float, float] = (0.0, 0.0)
    pull: tuple[float, float, float] = (0.0, 0.0, 0.0)


WORLD = {
    "body_anisotropy": Effect(0.3, of_slider=(0.3, 0.0)),
    "body_anisotropy_diagonal": Effect(-0.4, of_slider=(0.0, -0.4)),
    "grain_x": Effect(0.2, of_table=(0.2, 0.0)),
    "grain_diagonal": Effect(0.2, of_table=(0.0, 0.2)),
    "much body_anisotropy": Effect(0.75, of_slider=(0.75, 0.0)),
    "slope_x": Effect(0.5, pull=(0.5 * WEIGHT, 0.0, 0.0)),
    "slope_y": Effect(0.2, pull=(0.0, 0.2 * WEIGHT, 0.0)),
}


@cache
def simulated_effects() -> dict[str, Array]:
    """Displacements (N, 3) under each effect, all from one run."""
    of_slider, of_table, pull = (
        np.repeat([getattr(effect, name) for effect in WORLD.values()], N, axis=0)
        for name in ("of_slider", "of_table", "pull")
    )
    changes = Changes(
        grain=lambda moment: of_table + rotate(of_slider, 2.0 * moment.pose[:, 2]), pull=lambda moment: pull
    )
    found = simulated(RIM, plan(N).take(np.tile(np.arange(N), len(WORLD))), changes)
    return dict(zip(WORLD, np.split(found, len(WORLD)), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", WORLD)
def test_large_effects_in_the_simulator_are_those_of_the_parameter(name: str) -> None:
    truth, pushes, values = simulated_effects()[name], plan(N), {name.split()[-1]: WORLD[name].value}
    with_it, without = (relative_error(predicted(RIM, pushes, v), truth) for v in (values, {}))
    assert with_it < (0.05 if name.startswith("much") else 0.01)  # the shape of the surface is linear in the stretch
    assert with_it < 0.1 * without


@pytest.mark.slow
def test_friction_that_grows_over_the_table_turns_the_slider_as_predicted() -> None:
    row = np.linspace(-HALF_EXTENT, HALF_EXTENT, round(2.0 * HALF_EXTENT / CELL) + 1)
    table, pushes = FrictionField(0.25 * np.tile(1.0 + 2.0 * row, (len(row), 1))), plan(N)
    truth = simulated(RIM, pushes, table=table)
    with_it, without = (relative_error(predicted(RIM, pushes, v), truth) for v in ({"gradient_x": 2.0}, {}))
    assert with_it < 0.01
    assert with_it < 0.2 * without
