# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ARD squared exponential kernel and the regularised systems built on it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.ridge import DenseKernel, cholesky_in_place
from push_predictor.types import Array

KERNEL = ArdKernel(np.array([0.3, -0.4, 1.0]), 0.2)


def normal(*shape: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=shape)


def test_values_are_the_formula() -> None:
    left, right = normal(4, 3), normal(5, 3, seed=1)
    scaled = (left[:, None] - right) / np.exp(KERNEL.log_lengthscales)
    expected = np.exp(0.4) * np.exp(-0.5 * (scaled**2).sum(axis=2))
    np.testing.assert_allclose(KERNEL.cross(left, right), expected, rtol=1e-14)


@given(st.integers(0, 10_000), st.floats(-3.0, 3.0), st.floats(-3.0, 1.5))
def test_matrix_is_symmetric_positive_and_at_most_its_diagonal(seed: int, log_scale: float, log_sd: float) -> None:
    kernel = ArdKernel(np.full(2, log_scale), log_sd)
    matrix = kernel.matrix(normal(130, 2, seed=seed))  # some blocks
    assert (matrix == matrix.T).all()
    assert matrix.max() <= kernel.variance * (1.0 + 1e-14)
    np.testing.assert_allclose(np.diagonal(matrix), kernel.variance, rtol=1e-9)
    assert np.linalg.eigvalsh(matrix).min() > -1e-10 * kernel.variance


def test_gradient_equals_finite_differences() -> None:
    inputs, weights = normal(25, 3), normal(25, 25, seed=1)
    weights = weights + weights.T

    def contracted(vector: Array) -> float:
        return float((weights * ArdKernel(vector[:3], vector[3]).matrix(inputs)).sum())

    at = np.append(KERNEL.log_lengthscales, KERNEL.log_sd)
    gradient = KERNEL.gradient(inputs, KERNEL.matrix(inputs), weights.copy())
    steps = 1e-3 * np.eye(4)
    expected = [
        (8 * (contracted(at + h) - contracted(at - h)) - (contracted(at + 2 * h) - contracted(at - 2 * h))) / 12e-3
        for h in steps
    ]
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("n", [50, 300])
def test_a_regularised_kernel_equals_its_textbook_formulas(n: int) -> None:
    factorised = DenseKernel(ArdKernel(np.array([0.5, 0.5]), 0.1), normal(n, 2))
    matrix = factorised.matrix
    diagonal = np.exp(normal(n, seed=2))
    ridge = factorised.regularise(1.0 / diagonal)
    inverse = np.linalg.inv(matrix + np.diag(diagonal))
    values = normal(n, seed=3)
    np.testing.assert_allclose(ridge.precision(), inverse, atol=1e-11)
    np.testing.assert_allclose(ridge.residual(values), inverse @ (diagonal * values), atol=1e-10)
    np.testing.assert_allclose(ridge.posterior_diagonal, np.diagonal(matrix - matrix @ inverse @ matrix), atol=1e-10)
    expected = np.linalg.slogdet(matrix + np.diag(diagonal))[1] - np.log(diagonal).sum()
    assert ridge.log_determinant == pytest.approx(expected, abs=1e-9)


def test_posterior_of_a_noiseless_function_passes_through_its_values() -> None:
    inputs, values = normal(15, 3), normal(15, seed=1)
    ridge = DenseKernel(KERNEL, inputs).regularise(np.full(15, 1e10))
    mean, explained = ridge.posterior(ridge.residual(1e10 * values)).predict(inputs)
    np.testing.assert_allclose(mean, values, atol=1e-6)
    np.testing.assert_allclose(explained, KERNEL.variance, atol=1e-8)


def test_rejects_matrix_that_is_not_positive_definite() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        cholesky_in_place(np.ones((3, 3)) - 2.0 * np.eye(3))
