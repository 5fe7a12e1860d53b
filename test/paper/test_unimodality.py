# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Hartigan's dip test: against its definition as a linear programme, and on distributions with known modes."""

from __future__ import annotations

import numpy as np
import pytest
from push_predictor_paper.statistics.unimodality import dip, holm, p_values, power, uniform_dips
from scipy.optimize import linprog

from push_predictor.types import Array


def dip_by_definition(sample: Array) -> float:
    """The smallest distance of a unimodal distribution function, over all modes; it may jump at its mode only."""
    x = np.sort(sample)
    return min(distance_with_mode(x, mode) for mode in range(len(x)))


def distance_with_mode(x: Array, mode: int) -> float:
    # Unknown: G at each point, G just left of the mode, the distance d. G is convex left of the mode, concave right.
    n = len(x)
    rows: list[Array] = []
    bounds: list[float] = []

    def require(coefficients: dict[int, float], d: float, most: float) -> None:
        row = np.zeros(n + 2)
        for place, value in coefficients.items():
            row[place] += value
        row[-1] += d
        rows.append(row)
        bounds.append(most)

    for i in range(n):
        require({n if i == mode else i: 1.0}, -1.0, i / n)  # left limit of the sample's function: i / n
        require({i: -1.0}, -1.0, -(i + 1) / n)
    require({mode: 1.0}, -1.0, (mode + 1) / n)
    require({n: -1.0}, -1.0, -mode / n)
    require({n: 1.0, mode: -1.0}, 0.0, 0.0)
    left = [*range(mode), n]
    for side, sign in ((left, 1.0), (list(range(mode, n)), -1.0)):
        at = [mode if place == n else place for place in side]
        for k in range(len(side) - 1):
            require({side[k]: 1.0, side[k + 1]: -1.0}, 0.0, 0.0)
        for k in range(len(side) - 2):
            one, two = 1.0 / (x[at[k + 1]] - x[at[k]]), 1.0 / (x[at[k + 2]] - x[at[k + 1]])
            require({side[k]: -sign * one, side[k + 1]: sign * (one + two), side[k + 2]: -sign * two}, 0.0, 0.0)
    cost = np.append(np.zeros(n + 1), 1.0)
    return float(linprog(cost, np.array(rows), bounds, bounds=(0.0, 1.0)).fun)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 7, 10])
def test_dip_equals_its_definition(n: int) -> None:
    rng = np.random.default_rng(n)
    samples = rng.standard_normal((6, n)) + 4.0 * rng.integers(0, 3, (6, n))
    np.testing.assert_allclose(dip(samples), [dip_by_definition(sample) for sample in samples], atol=1e-9)


def test_smallest_dip_is_half_a_sample_as_of_even_spacing() -> None:
    samples = np.random.default_rng(0).standard_normal((500, 25))
    assert dip(samples).min() >= 1.0 / 50.0
    assert dip(np.arange(25.0)[None])[0] == pytest.approx(1.0 / 50.0, abs=1e-15)


def test_two_points_have_the_largest_dip() -> None:
    assert dip(np.repeat([[0.0, 1.0]], 50, axis=1))[0] == pytest.approx(0.25, abs=0.006)
    assert dip(np.repeat([[0.0, 1.0]], 50, axis=1))[0] <= 0.25 + 1e-9


def test_accepts_equal_values() -> None:
    assert dip(np.zeros((1, 10)))[0] == pytest.approx(0.05)
    rounded = np.round(np.random.default_rng(3).standard_normal((20, 100)), 1)
    assert np.isfinite(dip(rounded)).all()


def test_dip_is_invariant_to_location_scale_and_order() -> None:
    rng = np.random.default_rng(1)
    samples = rng.standard_normal((50, 60)) + 3.0 * rng.integers(0, 2, (50, 60))
    expected = dip(samples)
    np.testing.assert_allclose(dip(-7.0 * samples + 2.0), expected, atol=1e-12)
    np.testing.assert_allclose(dip(rng.permuted(samples, axis=1)), expected, atol=1e-15)


def test_samples_are_independent_of_each_other() -> None:
    samples = np.random.default_rng(2).standard_normal((30, 40))
    np.testing.assert_array_equal(dip(samples), np.concatenate([dip(sample[None]) for sample in samples]))


def test_quantiles_of_the_uniform_equal_the_published_table() -> None:
    # Table of the R package diptest, a million samples each, n = 100 and 30; the tolerance is four standard errors.
    for n, published in ((100, [0.035462, 0.047153, 0.051128]), (30, [0.061451, 0.081479, 0.088169])):
        found = np.quantile(uniform_dips(n, 10_000), [0.5, 0.9, 0.95])
        np.testing.assert_allclose(found, published, rtol=0.02)


def test_p_values_are_uniform_for_the_uniform_and_small_for_two_modes() -> None:
    rng = np.random.default_rng(5)
    p = p_values(dip(rng.random((400, 30))), 30, 2000)
    assert np.quantile(p, 0.5) == pytest.approx(0.5, abs=0.08)
    assert 0.02 < np.mean(p <= 0.05) < 0.09
    two = dip(rng.standard_normal((1, 30)) + 20.0 * (np.arange(30) % 2))
    assert p_values(two, 30, 2000)[0] == 1.0 / 2001.0


def test_more_draws_resolve_smaller_p_values_and_leave_large_ones_where_they_are() -> None:
    rng = np.random.default_rng(6)
    dips = dip(
        np.concatenate([rng.standard_normal((5, 33)), rng.standard_normal((1, 33)) + 20.0 * (np.arange(33) % 2)])
    )
    many = p_values(dips, 33, 8000)
    np.testing.assert_allclose(many[:5], p_values(dips[:5], 33, 2000), atol=0.03)  # three standard errors
    assert many[:5].min() > 0.2
    assert many[5] == 1.0 / 8001.0
    assert p_values(dips[5:], 33, 2000)[0] == 1.0 / 2001.0


def test_holm_equals_values_computed_by_hand() -> None:
    np.testing.assert_allclose(holm(np.array([0.04, 0.01, 0.03, 0.5])), [0.09, 0.04, 0.09, 0.5])
    assert holm(np.array([0.6, 0.7])).max() == 1.0
    assert holm(np.zeros(0)).shape == (0,)


def test_power_grows_with_the_distance_of_the_modes() -> None:
    found = [power(50, apart, 0.08, draws=200) for apart in (0.0, 3.0, 5.0, 8.0)]
    assert found == sorted(found) and found[0] < 0.05 and found[-1] > 0.95
