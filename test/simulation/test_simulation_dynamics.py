# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated slider obeys Newton and Coulomb, and quasi-static mechanics if slow; the noise of repeated pushes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from even_physics import no_noise, uniform_field

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.recordings.table import PushTable
from push_predictor.simulation.dynamics import Motion, run, steps_of
from push_predictor.simulation.physics import GRAVITY, KNOT_SPACING, PERSISTENT_SHARE, Physics, noise_from_draws
from push_predictor.simulation.pushes import PusherPath, PushPlan, grid_pushes, pusher_path, random_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, push_outcomes
from push_predictor.simulation.slider import Slider, built_shares, pressure_patterns, slider_named, support_points
from push_predictor.simulation.surface import CELL, SURFACES, friction_field
from push_predictor.types import Array

RADIUS = 0.00475
FRICTION = 0.2
ACCELERATION = 2.5
LET_GO_STEP = 5e-4  # s


def even_physics(slider: Slider, n: int, contact_friction: float | Array = 0.25, friction: float = FRICTION) -> Physics:
    """n equal sliders with uniform load on a uniform table."""
    points = support_points(slider.outline)
    return Physics(
        outline=slider.outline,
        radius=RADIUS,
        mass=np.full(n, slider.mass),
        inertia=np.full(n, slider.inertia),
        support=points,
        shares=np.full((n, len(points)), 1.0 / len(points)),
        contact_friction=np.full(n, contact_friction),
        surface=uniform_field(friction),
        load_noise=no_noise(n, len(points)),
        contact_noise=no_noise(n, 1),
    )


def push(
    physics: Physics, plan: PushPlan, poses: Array | None = None, *, rest: float = 0.1, coarse: float = 1.0
) -> Motion:
    """coarse: factor on the usual time steps, where a property holds for any."""
    start = np.zeros((len(plan), 3)) if poses is None else poses
    path = pusher_path(plan, physics.outline, physics.radius, start, ACCELERATION)
    return run(physics, path, start, path.total_time + rest, time_step=coarse * steps_of(path))


def let_go(physics: Physics, velocity: Array, duration: float) -> Motion:
    """Free motion of sliders with initial velocities, far from the rod."""
    n = len(velocity)
    away = PusherPath(np.full((n, 2), 1.0), np.tile([1.0, 0.0], (n, 1)), np.full(n, 0.01), np.full(n, 0.01), 1.0)
    still = np.zeros((n, 3))
    return run(physics, away, still, np.full(n, duration), velocity=velocity, time_step=np.full(n, LET_GO_STEP))


def travelled(motion: Motion) -> Array:
    return motion.slider[:, -1] - motion.slider[:, 0]


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["rect1", "ellip3"])
def test_free_slider_stops_when_friction_has_dissipated_its_energy(shape: str) -> None:
    rng = np.random.default_rng(2)
    speed, direction = rng.uniform(0.05, 0.15, 8), rng.uniform(-np.pi, np.pi, 8)
    velocity = np.column_stack([speed * np.cos(direction), speed * np.sin(direction), np.zeros(8)])
    end = travelled(let_go(even_physics(slider_named(shape), 8), velocity, duration=0.09))
    assert np.hypot(*end[:, :2].T) == pytest.approx(speed**2 / (2.0 * FRICTION * GRAVITY), rel=0.02, abs=2e-5)
    assert np.arctan2(end[:, 1], end[:, 0]) == pytest.approx(direction, abs=1e-3)
    assert np.all(np.abs(end[:, 2]) < 1e-6)


@pytest.mark.slow
def test_motion_on_uniform_table_is_invariant_to_place_and_heading() -> None:
    plan = random_pushes(6, [0.04, 0.1], 0.005, np.random.default_rng(5))
    poses = np.random.default_rng(6).normal(size=(6, 3)) * [0.03, 0.03, 1.0]
    twice = PushPlan(*(np.tile(values, 2) for values in (plan.contact, plan.angle, plan.speed, plan.travel)))
    motion = push(
        even_physics(slider_named("hex"), 12), twice, np.concatenate([poses, np.zeros((6, 3))]), rest=0.0, coarse=3.0
    )
    there, here = np.split(travelled(motion), 2)
    assert np.allclose(rotate(there[:, :2], -poses[:, 2]), here[:, :2], atol=1e-9)
    assert np.allclose(there[:, 2], here[:, 2], atol=1e-8)


def test_force_through_the_centre_equals_friction_times_weight() -> None:
    plan = PushPlan(np.array([0.125]), np.array([0.0]), np.array([0.01]), np.array([0.01]))
    slider = slider_named("rect1")
    motion = push(even_physics(slider, 1), plan)
    assert -np.median(motion.wrench[0, :, 0]) == pytest.approx(FRICTION * slider.mass * GRAVITY, rel=0.01)
    assert np.max(np.abs(motion.wrench[0, :, 1:])) < 1e-6


@pytest.mark.slow
def test_contact_force_stays_in_the_friction_cone_and_never_pulls() -> None:
    plan = random_pushes(8, [0.04, 0.1], 0.006, np.random.default_rng(8))
    physics = even_physics(slider_named("ellip3"), 8, contact_friction=0.25)
    motion = push(physics, plan, rest=0.0, coarse=3.0)
    poses, tips = motion.slider[:, :-1].reshape(-1, 3), motion.pusher[:, :-1].reshape(-1, 2)
    normal = rotate(physics.outline.project(to_body(tips, poses)).normal, poses[:, 2])
    force = motion.wrench[:, 1:, :2].reshape(-1, 2)
    pressing = np.sum(force * normal, axis=1)
    rubbing = np.abs(normal[:, 0] * force[:, 1] - normal[:, 1] * force[:, 0])
    assert np.min(pressing) >= -1e-9
    assert np.all(rubbing <= 0.25 * pressing + 1e-9)


@pytest.mark.parametrize("shape", ["rect1", "ellip1", "ellip2", "ellip3", "hex"])
def test_moment_of_inertia_equals_that_of_a_uniform_plate(shape: str) -> None:
    outline = slider_named(shape).outline
    reach = float(np.max(np.abs(outline.vertices)))
    axis = (np.arange(300) + 0.5) / 150.0 * reach - reach
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    inside = grid[outline.project(grid).distance < 0.0]
    assert outline.polar_moment == pytest.approx(np.mean(np.sum(inside**2, axis=1)), rel=5e-3)
    assert np.allclose(np.mean(support_points(outline), axis=0), 0.0, atol=1e-12)


# --- noise of repeated pushes (Bauza and Rodriguez 2017) ---


CONTACTS, ANGLES, REPETITIONS = np.linspace(0.02, 0.23, 5), np.linspace(-1.2, 1.2, 5), 8


@cache
def first_windows(surface: str) -> PushTable:
    """The first 0.2 s of every push of a grid of repeated pushes, in order of the plan."""
    plan = grid_pushes(CONTACTS, ANGLES, REPETITIONS, travel=0.005)
    table = push_outcomes(SimulationSpec("rect1", surface, plan, seed=3))
    push = table.push_id.astype(int)
    return table.take(np.unique(push, return_index=True)[1])


def spread(table: PushTable) -> tuple[Array, Array]:
    """Standard deviation and mean (cells, 3) of the outcomes of equal pushes."""
    cell = table.push_id.astype(int) % (len(CONTACTS) * len(ANGLES))
    groups = [table.outcomes[cell == k] for k in np.unique(cell)]
    return np.array([g.std(axis=0) for g in groups]), np.array([g.mean(axis=0) for g in groups])


@pytest.mark.slow
def test_noise_of_repeated_pushes_is_a_tenth_to_some_tenths_and_depends_on_the_push() -> None:
    deviation, mean = spread(first_windows("abs"))
    share = np.median(deviation / np.abs(mean), axis=0)
    assert np.all(share > 0.08)
    assert np.all(share < 0.45)
    assert np.all(np.max(deviation, axis=0) > 4.0 * np.min(deviation, axis=0))


@pytest.mark.slow
def test_table_and_pushes_depend_only_on_their_own_seeds() -> None:
    one, same, other = (friction_field(SURFACES["abs"], seed).values for seed in (0, 0, 1))
    assert np.array_equal(one, same)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.1
    plan = grid_pushes([0.1], [0.3], 5, travel=0.005)
    three, four = (push_outcomes(SimulationSpec("rect1", "abs", plan, seed=seed)).outcomes for seed in (3, 4))
    assert not np.allclose(three[:5], four[:5])


@pytest.mark.parametrize("name", sorted(SURFACES))
def test_friction_has_the_mean_variation_and_correlation_of_its_surface(name: str) -> None:
    surface = SURFACES[name]
    values = friction_field(surface, 7).values
    assert np.mean(values) == pytest.approx(surface.friction, rel=0.05)
    logs = np.log(values) - np.mean(np.log(values))
    assert np.std(logs) == pytest.approx(surface.variation, rel=0.05)
    lag = round(surface.correlation / CELL)
    correlation = np.mean(logs[:, :-lag] * logs[:, lag:]) / np.mean(logs**2)
    assert correlation == pytest.approx(np.exp(-0.5), abs=0.12)


def test_friction_is_linear_between_grid_points_and_constant_beyond_the_table() -> None:
    field = friction_field(SURFACES["pu"], 0)
    left, middle, right = field.at(np.array([0.0, CELL / 2.0, CELL]), np.zeros(3))
    assert middle == pytest.approx((left + right) / 2.0, rel=1e-9)
    assert uniform_field(0.3).at(np.array([9.0]), np.array([-9.0])) == pytest.approx(0.3)


def test_manufactured_slider_is_nearly_uniform() -> None:
    points = support_points(slider_named("rect1").outline)
    shares = np.array([built_shares(points, seed) for seed in range(50)])
    assert np.allclose(np.sum(shares, axis=1), 1.0)
    assert np.all(shares > 0.0)
    centre = shares @ points
    assert 0.0005 < np.sqrt(np.mean(centre**2)) < 0.005


def test_pressure_noise_has_unit_variance_along_the_whole_push() -> None:
    points, rng = support_points(slider_named("rect1").outline), np.random.default_rng(1)
    patterns = pressure_patterns(points, 2000 * 6, rng).reshape(2000, 6, -1)
    noise = noise_from_draws(patterns)
    for travelled in KNOT_SPACING * np.array([0.0, 0.5, 2.3, 9.0]):
        assert np.sqrt(np.mean(noise.at(np.full(2000, travelled)) ** 2)) == pytest.approx(1.0, rel=0.03)
    near, far = (
        np.mean(noise.at(np.zeros(2000)) * noise.at(np.full(2000, travelled)))
        for travelled in (0.3 * KNOT_SPACING, 2.0 * KNOT_SPACING)
    )
    assert near > 0.8
    assert far == pytest.approx(PERSISTENT_SHARE, abs=0.05)
