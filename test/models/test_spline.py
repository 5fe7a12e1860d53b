# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Splines on boxes: the compiled evaluation, interpolation from nodes and knots, and the moments kept as splines."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import comb

import numpy as np
import pytest

from push_predictor.models.predictors.correlation import covariances
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline, along_all
from push_predictor.models.tabulated.spline import spline_values, table_moments
from push_predictor.types import Array

AXES = (Axis(-1.0, 2.0, 5), Axis(0.0, 0.5, 7), Axis(3.0, 4.0, 3))
ENDS = np.array([[axis.low, axis.high] for axis in AXES])


def basis(u: Array) -> Array:
    """The cardinal cubic B-spline, from its sum of truncated powers; not zero between 0 and 4."""
    return sum((-1) ** k * comb(4, k) * np.maximum(u - k, 0.0) ** 3 / 6.0 for k in range(5))


def by_formula(axes: Sequence[Axis], coefficients: Array, points: Array, box: Array) -> Array:
    """Sum of all products of B-splines, with those that are zero too."""
    factors = []
    for axis, x in zip(axes, points.T, strict=True):
        place = (x - axis.low) * axis.cells / (axis.high - axis.low)
        factors.append(basis(place[:, None] + 3.0 - np.arange(axis.cells + 3)))
    found = coefficients[box]
    for factor in factors:
        found = np.einsum("ni,ni...->n...", factor, found)
    return np.asarray(found)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("functions", [1, 9, 16])
def test_compiled_spline_is_the_sum_of_its_basis(count: int, functions: int) -> None:
    """At random points, at knots, and at both ends of every axis, in several boxes; summed in single precision."""
    axes, draw = AXES[:count], np.random.default_rng(0)
    coefficients = draw.standard_normal((3, *(axis.cells + 3 for axis in axes), functions)).astype(np.float32)
    corners = np.array(list(product(*ENDS[:count])))
    knots = np.array([[axis.low + (axis.high - axis.low) * k / axis.cells for axis in axes] for k in range(3)])
    points = np.concatenate([draw.uniform(*ENDS[:count].T, (60, count)), corners, knots])
    box = draw.integers(0, 3, len(points))
    expected = by_formula(axes, coefficients.astype(np.float64), points, box)
    rounding = 4**count * np.finfo(np.float32).eps * np.abs(coefficients).max()
    np.testing.assert_allclose(TensorSpline(axes, coefficients)(points, box), expected, rtol=0.0, atol=rounding)


def test_more_functions_or_axes_than_the_compiled_code_has_places_for_are_refused() -> None:
    one = np.ones(1)
    for axes, functions in ((4, 1), (1, 17), (0, 1)):
        with pytest.raises(ValueError, match="1 to 3 and at most 16 are accepted"):
            spline_values(
                np.zeros((1, axes)), np.zeros(1, np.intp), one, one, np.ones(1, np.intp),
                np.zeros((4, functions), np.float32), np.zeros((1, functions)),
            )  # fmt: skip


def through(axes: Sequence[Axis], values: Array) -> TensorSpline:
    """The spline that takes values (cells_1 + 1, ..., K) at the knots."""
    return TensorSpline(axes, along_all([axis.coarse_to_coefficients(axis.cells) for axis in axes], values[None]))


def test_spline_interpolates_knots_and_reproduces_cubics() -> None:
    axes = AXES[:2]

    def cubic(x: Array, y: Array) -> Array:
        return np.stack([x**3 - 2.0 * x * y**2 + 1.0, y**3 * x**2], axis=-1)

    knots = np.meshgrid(*(np.linspace(axis.low, axis.high, axis.cells + 1) for axis in axes), indexing="ij")
    points = np.random.default_rng(0).uniform([-1.0, 0.0], [2.0, 0.5], (50, 2))
    points = np.concatenate([points, [[-1.0, 0.0], [2.0, 0.5]]])
    found = through(axes, cubic(*knots))(points, np.zeros(len(points), np.intp))
    assert found == pytest.approx(cubic(*points.T), abs=1e-5)  # coefficients have single precision


def test_few_nodes_resolve_a_smooth_function() -> None:
    axis = Axis(0.2, 3.0, 10)
    for count, error in ((8, 1e-2), (16, 1e-6), (24, 1e-11)):
        knots = axis.nodes_to_knots(count) @ np.exp(-(axis.nodes(count) ** 2))
        assert knots == pytest.approx(np.exp(-(np.linspace(0.2, 3.0, 11) ** 2)), abs=error)


@pytest.mark.parametrize("coupled", [False, True])
def test_moments_are_the_covariances_of_variances_and_correlation(coupled: bool) -> None:
    """The partial correlations in the table are inverse hyperbolic tangents; see partial_correlation."""
    draw, n = np.random.default_rng(1), 40
    values = draw.standard_normal((n, 12 if coupled else 9))
    least = np.array([0.1, 0.2, 0.05])
    correlation = None
    if coupled:
        first, second, partial = np.tanh(values[:, 9:]).T
        third = first * second + partial * np.sqrt((1.0 - first**2) * (1.0 - second**2))
        correlation = np.tile(np.eye(3), (n, 1, 1))
        for (i, j), r in zip(((0, 1), (0, 2), (1, 2)), (first, second, third), strict=True):
            correlation[:, i, j] = correlation[:, j, i] = r
    expected = covariances(np.maximum(values[:, 3:6], least), np.exp(values[:, 6:9]), correlation)
    found = np.full((n, 3, 3), np.nan), np.full((n, 3, 3), np.nan)
    table_moments(values, least, *found)
    for ours, theirs in zip(found, expected, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-13)
    assert np.any(values[:, 3:6] < least) and np.all(np.linalg.eigvalsh(found[0]) > 0.0)
