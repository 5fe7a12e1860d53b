# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sparse bound: the dense one if every row is an inducing input, else below it; choice of inducing inputs."""

from __future__ import annotations

import numpy as np
import pytest
from sparse_rows import PARAMETERS, rows

from push_predictor.models.gaussian_process.bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.fit import maximise_over_noise
from push_predictor.models.gaussian_process.inducing import InducedKernel, inducing_rows
from push_predictor.models.gaussian_process.sparse_vhgp import noise_prior
from push_predictor.types import Array


def problem(n: int, signal: int, noise: int, parameters: VhgpParameters = PARAMETERS) -> VhgpProblem:
    """With the first `signal` rows for inducing inputs of f, the last `noise` for those of g."""
    inputs, outputs = rows(n)
    of_signal = InducedKernel.of(parameters.signal, inputs, inputs[:signal])
    of_noise = InducedKernel.of(parameters.noise, inputs, inputs[n - noise :])
    return VhgpProblem(outputs, parameters, of_signal, of_noise)


def test_bound_equals_dense_one_if_every_row_is_inducing() -> None:
    inputs, outputs = rows(60)
    sites = np.exp(0.5 * np.random.default_rng(1).normal(size=60) - 0.7)
    dense = Bound.tied(VhgpProblem.of(inputs, outputs, PARAMETERS), sites)
    sparse = Bound.tied(problem(60, 60, 60), sites)
    assert sparse.value == pytest.approx(dense.value, abs=1e-6)
    np.testing.assert_allclose(sparse.signal.optimal_precisions, dense.signal.optimal_precisions, atol=1e-6)


def test_maximum_over_q_equals_that_of_the_dense_bound() -> None:
    dense = maximise_over_noise(VhgpProblem.of(*rows(60), PARAMETERS), None, 1e-13)
    sparse = maximise_over_noise(problem(60, 60, 60), None, 1e-13)
    assert sparse.value == pytest.approx(dense.value, abs=1e-6)
    np.testing.assert_allclose(sparse.hyperparameter_gradient(), dense.hyperparameter_gradient(), atol=1e-5)


def test_fewer_inducing_inputs_never_give_a_higher_bound() -> None:
    dense = maximise_over_noise(VhgpProblem.of(*rows(60), PARAMETERS), None, 1e-10).value
    values = [maximise_over_noise(problem(60, m, m), None, 1e-10).value for m in (60, 40, 20, 10)]
    assert values[0] == pytest.approx(dense, abs=1e-6)
    assert dense > values[1] > values[2] > values[3]


def settled(bound: Bound) -> Bound:
    """The bound is flat at its maximum, to rounding: only further steps bring the sites there, and with them the
    gradient, which feels them in the first order.
    """
    for _ in range(6):
        bound = Bound.at(bound.problem, bound.optimal_sites)
    return bound


ACROSS = np.random.default_rng(6).normal(size=(1, 8))  # a direction in which all hyperparameters change


@pytest.mark.parametrize(("n", "signal", "noise", "directions"), [(60, 20, 30, np.eye(8)), (4500, 12, 9, ACROSS)])
def test_gradient_of_every_hyperparameter_equals_finite_differences(
    n: int, signal: int, noise: int, directions: Array
) -> None:
    """Also across several blocks of rows."""

    def maximum(vector: Array) -> Bound:
        return settled(maximise_over_noise(problem(n, signal, noise, VhgpParameters.from_vector(vector)), None, 0.0))

    at, h = PARAMETERS.to_vector(), 1e-3
    gradient = maximum(at).hyperparameter_gradient()
    for step in h * directions:
        near = maximum(at + step).value - maximum(at - step).value
        far = maximum(at + 2 * step).value - maximum(at - 2 * step).value
        expected = (8.0 * near - far) / (12.0 * h)
        assert gradient @ step / h == pytest.approx(expected, abs=1e-7 * np.abs(gradient).max())


def test_the_prior_is_for_the_noise_alone_and_has_its_gradient() -> None:
    vector, h = PARAMETERS.to_vector(), 1e-4
    prior, twice = noise_prior(2, 300), noise_prior(2, 600)
    numbers = [(prior.penalty(vector + s)[0] - prior.penalty(vector - s)[0]) / (2.0 * h) for s in h * np.eye(8)]
    slope = prior.penalty(vector)[1]
    np.testing.assert_allclose(slope, numbers, atol=1e-7)
    assert np.flatnonzero(slope).tolist() == [3, 4, 5, 7]
    np.testing.assert_allclose(twice.penalty(vector)[1][3:6], 2.0 * slope[3:6])
    assert twice.penalty(vector)[1][7] == slope[7]


def test_unexplained_variance_is_kernel_diagonal_minus_explained() -> None:
    inputs, _ = rows(50)
    kernel = PARAMETERS.signal
    induced = InducedKernel.of(kernel, inputs, inputs[:15])
    cross, between = kernel.cross(inputs, inputs[:15]), kernel.matrix(inputs[:15])
    explained = cross @ np.linalg.solve(between + 1e-9 * kernel.variance * np.eye(15), cross.T)
    np.testing.assert_allclose(induced.unexplained, kernel.variance - np.diagonal(explained), atol=1e-7)
    np.testing.assert_allclose(induced.times(inputs[:, 0]), explained @ inputs[:, 0], atol=1e-6)
    weights = np.exp(inputs[:, 1])
    ridge, precision = induced.regularise(weights), np.linalg.inv(explained + np.diag(1.0 / weights))
    np.testing.assert_allclose(ridge.residual(inputs[:, 0]), precision @ (inputs[:, 0] / weights), atol=1e-6)
    np.testing.assert_allclose(
        ridge.posterior_diagonal, np.diagonal(explained - explained @ precision @ explained), atol=1e-6
    )


def test_inducing_inputs_explain_more_than_random_rows() -> None:
    inputs, _ = rows(2000)
    kernel = PARAMETERS.signal
    chosen = inducing_rows(kernel, inputs, 30)
    assert len(np.unique(chosen)) == 30
    at_random = np.random.default_rng(0).permutation(2000)[:30]
    unknown, then = (InducedKernel.of(kernel, inputs, inputs[z]).unexplained.max() for z in (chosen, at_random))
    assert unknown < 0.3 * then


def test_selection_stops_when_few_rows_determine_all_others() -> None:
    inputs = np.random.default_rng(0).integers(0, 3, size=(500, 2)).astype(float)
    chosen = inducing_rows(PARAMETERS.signal, inputs, 100)
    assert len(chosen) == 9
    assert len(np.unique(inputs[chosen], axis=0)) == 9


def test_held_out_prediction_is_that_of_the_dense_matrices_and_has_what_is_unexplained() -> None:
    n, block = 60, np.arange(60) // 7
    found, sites = problem(n, 12, 9), np.exp(0.5 * np.random.default_rng(1).normal(size=n) - 0.7)
    bound = Bound.tied(found, sites)
    held_out = bound.held_out(block)
    level = bound.signal.level
    kernels = (
        (found.signal, found.signal.times, 1.0 / (level + PARAMETERS.jitter), level),
        (found.noise, found.noise_times, sites, 1.0 / sites),
    )
    variances = held_out.variance, held_out.log_noise_variance
    for (kernel, times, weights, own), variance in zip(kernels, variances, strict=True):
        explained = np.column_stack([times(column) for column in np.eye(n)])
        precision = np.linalg.inv(explained + np.diag(1.0 / weights))
        assert np.max(kernel.unexplained) > 1e-3
        for number in range(9):
            rows_of = np.flatnonzero(block == number)
            expected = np.diagonal(np.linalg.inv(precision[np.ix_(rows_of, rows_of)])) - own[rows_of]
            unexplained = np.broadcast_to(kernel.unexplained, n)[rows_of]
            np.testing.assert_allclose(variance[rows_of], expected + unexplained, rtol=1e-5)
