"""Pushes repeated on the simulated rig scatter, and how much depends on the push (Bauza and Rodriguez 2017)."""

from __future__ import annotations

import numpy as np
import pytest

from push_predictor.recordings.table import PushTable
from push_predictor.simulation.noise import KNOT, LASTING, mixed
from push_predictor.simulation.pushes import grid_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, push_outcomes
from push_predictor.simulation.slider import built_shares, pressure_patterns, slider_named, support_points
from push_predictor.simulation.surface import CELL, SURFACES, friction_field, uniform_field
from push_predictor.types import Array

CONTACTS, ANGLES, REPETITIONS = np.linspace(0.02, 0.23, 5), np.linspace(-1.2, 1.2, 5), 40


def first_windows(surface: str, seed: int = 3) -> PushTable:
    """The first 0.2 s of every push of a grid of repeated pushes, in order of the plan."""
    plan = grid_pushes(CONTACTS, ANGLES, REPETITIONS, travel=0.008)
    table = push_outcomes(SimulationSpec("rect1", surface, plan, seed=seed))
    push = table.push_id.astype(int)
    return table.take(np.unique(push, return_index=True)[1])


def scatter(table: PushTable) -> tuple[Array, Array]:
    """Standard deviation and mean (cells, 3) of the outcomes of equal pushes."""
    cell = table.push_id.astype(int) % (len(CONTACTS) * len(ANGLES))
    groups = [table.outcomes[cell == k] for k in np.unique(cell)]
    return np.array([g.std(axis=0) for g in groups]), np.array([g.mean(axis=0) for g in groups])


def test_repeated_pushes_scatter_by_a_tenth_to_some_tenths_and_not_everywhere_alike() -> None:
    deviation, mean = scatter(first_windows("abs"))
    share = np.median(deviation / np.abs(mean), axis=0)
    assert np.all(share > 0.08)
    assert np.all(share < 0.45)
    assert np.all(np.max(deviation, axis=0) > 4.0 * np.min(deviation, axis=0))


def test_surfaces_differ_in_their_scatter() -> None:
    smooth, rough = (np.median(scatter(first_windows(name))[0], axis=0) for name in ("delrin", "pu"))
    assert np.all(rough > 1.4 * smooth)


def test_the_table_is_fixed_by_its_seed_and_the_pushes_by_theirs() -> None:
    one, same, other = (friction_field(SURFACES["abs"], seed).values for seed in (0, 0, 1))
    assert np.array_equal(one, same)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.1
    assert not np.allclose(first_windows("abs", 3).outcomes[:5], first_windows("abs", 4).outcomes[:5])


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


def test_between_grid_points_friction_is_linear_and_beyond_the_table_it_is_the_rims() -> None:
    field = friction_field(SURFACES["pu"], 0)
    left, middle, right = field.at(np.array([0.0, CELL / 2.0, CELL]), np.zeros(3))
    assert middle == pytest.approx((left + right) / 2.0, rel=1e-9)
    assert uniform_field(0.3).at(np.array([9.0]), np.array([-9.0])) == pytest.approx(0.3)


def test_the_slider_is_made_nearly_even() -> None:
    points = support_points(slider_named("rect1").outline)
    shares = np.array([built_shares(points, seed) for seed in range(50)])
    assert np.allclose(np.sum(shares, axis=1), 1.0)
    assert np.all(shares > 0.0)
    centre = shares @ points
    assert 0.0005 < np.sqrt(np.mean(centre**2)) < 0.005


def test_pressure_varies_by_as_much_as_asked_at_every_way_of_the_tip() -> None:
    points, rng = support_points(slider_named("rect1").outline), np.random.default_rng(1)
    patterns = pressure_patterns(points, 2000 * 6, rng).reshape(2000, 6, -1)
    scatter = mixed(patterns)
    for way in (0.0, 0.5 * KNOT, 2.3 * KNOT, 9.0 * KNOT):
        assert np.sqrt(np.mean(scatter.at(np.full(2000, way)) ** 2)) == pytest.approx(1.0, rel=0.03)
    near, far = (
        np.mean(scatter.at(np.zeros(2000)) * scatter.at(np.full(2000, way))) for way in (0.3 * KNOT, 2.0 * KNOT)
    )
    assert near > 0.8
    assert far == pytest.approx(LASTING, abs=0.05)


def test_along_a_push_the_scatter_is_partly_lasting_partly_new() -> None:
    plan = grid_pushes([0.125], [0.0], 200, travel=0.03)
    table = push_outcomes(SimulationSpec("rect1", "abs", plan, seed=2, place_spread=0.0, turn_spread=0.0))
    push = table.push_id.astype(int)
    turn = np.array([table.outcomes[push == k][:4, 2] for k in np.unique(push)])
    correlation = np.corrcoef(turn.T)[0, 1:]
    assert np.all(np.abs(correlation) < 0.8)
