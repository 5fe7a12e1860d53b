# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Symmetric matrices of which only one triangle is computed."""

from __future__ import annotations

import numpy as np
import pytest

from push_predictor.models.gaussian_process.kernels import ArdKernel, _upper_blocks, mirror_upper
from push_predictor.models.gaussian_process.ridge import DenseKernel
from push_predictor.types import Array

BLOCK = 64
SIZES = (1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5)


def normal(*shape: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=shape)


@pytest.mark.parametrize("n", SIZES)
def test_blocks_cover_the_upper_triangle_and_only_their_squares_reach_below(n: int) -> None:
    covered = np.zeros((n, n), dtype=int)
    for rows, columns in _upper_blocks(n):
        covered[rows, columns] += 1
    assert (covered[np.triu_indices(n)] == 1).all()
    below, left = np.nonzero(np.tril(covered, -1))
    assert (below // BLOCK == left // BLOCK).all()


@pytest.mark.parametrize("n", SIZES)
def test_the_mirrored_matrix_has_the_upper_triangle_twice(n: int) -> None:
    matrix = normal(n, n)
    expected = np.triu(matrix) + np.triu(matrix, 1).T
    np.testing.assert_array_equal(mirror_upper(matrix), expected)


def test_a_kernel_gradient_reads_the_upper_triangle_of_its_weights_only() -> None:
    inputs, weights = normal(150, 2), normal(150, 150, seed=1)
    kernel = ArdKernel(np.array([0.2, -0.3]), 0.1)
    matrix = kernel.matrix(inputs)
    of_triangle = kernel.gradient(inputs, matrix, np.triu(weights) + np.tril(np.full((150, 150), 1e6), -1))
    of_whole = kernel.gradient(inputs, matrix, np.triu(weights) + np.triu(weights, 1).T)
    np.testing.assert_allclose(of_triangle, of_whole, rtol=1e-10)


def test_the_upper_precision_is_that_of_the_whole() -> None:
    ridge = DenseKernel(ArdKernel(np.full(2, 0.5), 0.1), normal(300, 2)).regularise(np.exp(normal(300, seed=2)))
    np.testing.assert_array_equal(np.triu(ridge.upper_precision()), np.triu(ridge.precision()))
    np.testing.assert_array_equal(ridge.precision(), ridge.precision().T)
