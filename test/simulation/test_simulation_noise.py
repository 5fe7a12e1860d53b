# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repeated pushes on the simulated rig are noisy, and the noise depends on the push (Bauza and Rodriguez 2017)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from even_physics import uniform_field

from push_predictor.recordings.table import PushTable
from push_predictor.simulation.physics import KNOT_SPACING, PERSISTENT_SHARE, noise_from_draws
from push_predictor.simulation.pushes import grid_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, push_outcomes
from push_predictor.simulation.slider import built_shares, pressure_patterns, slider_named, support_points
from push_predictor.simulation.surface import CELL, SURFACES, friction_field
from push_predictor.types import Array

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
