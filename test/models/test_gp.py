# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The homoscedastic Gaussian process, its kernel, and what regressions share: densities, remembered results."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from likelihoods import log_marginal_likelihood
from scipy.integrate import quad
from scipy.stats import multivariate_normal

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process import gp
from push_predictor.models.gaussian_process.gp import (
    GaussianProcess,
    GpParameters,
    fit_gp,
    log_likelihood_and_gradient,
    some_rows,
)
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.prediction import (
    MOST_ROWS,
    LatentPrediction,
    Remembered,
    density_of_constant_noise,
    exact_log_density,
    gaussian_log_density,
)
from push_predictor.models.gaussian_process.regression import fit_constant
from push_predictor.models.gaussian_process.ridge import DenseKernel, cholesky_in_place
from push_predictor.models.gaussian_process.sparse_vhgp import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.types import Array, IntArray

PARAMETERS = GpParameters(np.array([0.2, -0.3]), 0.1, -1.2)


def rows(n: int, seed: int = 0, noise: float = 0.3) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(n, 2))
    return inputs, np.sin(2.0 * inputs[:, 0]) + noise * rng.normal(size=n)


def test_marginal_likelihood_is_the_density_of_the_outputs() -> None:
    inputs, outputs = rows(30)
    covariance = PARAMETERS.kernel.matrix(inputs) + PARAMETERS.noise_variance * np.eye(30)
    expected = multivariate_normal(np.zeros(30), covariance).logpdf(outputs)
    assert log_likelihood_and_gradient(inputs, outputs, PARAMETERS)[0] == pytest.approx(expected, abs=1e-9)


def test_prediction_is_the_conditional_gaussian() -> None:
    inputs, outputs = rows(30)
    new = rows(5, seed=1)[0]
    kernel = PARAMETERS.kernel
    gain = kernel.cross(new, inputs) @ np.linalg.inv(kernel.matrix(inputs) + PARAMETERS.noise_variance * np.eye(30))
    prediction = GaussianProcess(inputs, outputs, PARAMETERS).predict(new)
    np.testing.assert_allclose(prediction.mean, gain @ outputs, atol=1e-12)
    conditional = kernel.matrix(new) - gain @ kernel.cross(inputs, new)
    np.testing.assert_allclose(prediction.variance, np.diagonal(conditional), atol=1e-12)
    np.testing.assert_allclose(prediction.process_variance, PARAMETERS.noise_variance)


@pytest.mark.parametrize("n", [60, 300])
def test_gradient_equals_finite_differences(n: int) -> None:
    inputs, outputs = rows(n)
    at = np.append(PARAMETERS.log_lengthscales, [PARAMETERS.log_signal_sd, PARAMETERS.log_noise_sd])

    def value(vector: Array) -> float:
        parameters = GpParameters(vector[:2], vector[2], vector[3])
        return log_marginal_likelihood(GaussianProcess(inputs, outputs, parameters))

    found, gradient = log_likelihood_and_gradient(inputs, outputs, PARAMETERS)
    assert found == pytest.approx(value(at), abs=1e-8)
    for i, h in enumerate(1e-3 * np.eye(4)):
        expected = (8 * (value(at + h) - value(at - h)) - (value(at + 2 * h) - value(at - 2 * h))) / 12e-3
        assert gradient[i] == pytest.approx(expected, abs=1e-8 * np.abs(gradient).max())


@pytest.mark.parametrize("fit", [fit_gp, fit_vhgp, fit_sparse_vhgp])
@pytest.mark.parametrize(
    ("inputs", "outputs", "complaint"),
    [
        (np.zeros((5, 2)), np.zeros(4), "shape"),
        (np.zeros(5), np.zeros(5), "shape"),
        (np.zeros((1, 2)), np.zeros(1), "n >= 2"),
        (np.zeros((5, 2)), np.array([0.0, 0.0, np.nan, 0.0, 0.0]), "NaN"),
        (np.full((5, 2), np.inf), np.zeros(5), "infinity"),
    ],
)
def test_unusable_rows_are_refused(fit: Callable[..., object], inputs: Array, outputs: Array, complaint: str) -> None:
    with pytest.raises(TrainingError, match=complaint):
        fit(inputs, outputs)


def test_jumps_are_learnt_from_part_of_the_rows() -> None:
    rng, n = np.random.default_rng(1), 450
    side, along = rng.integers(8, size=n), rng.random(n)
    outputs = (-1.0) ** side * (2.0 * along - 1.0) + 0.1 * rng.normal(size=n)
    inputs = np.column_stack([3.0 * side + along, rng.uniform(-1.0, 1.0, n)])
    inputs, outputs = ((x - x.mean(axis=0)) / x.std(axis=0) for x in (inputs, outputs))
    assert np.exp(fit_gp(inputs, outputs).parameters.log_noise_sd) < 0.25


def test_a_rough_fit_has_the_hyperparameters_of_some_rows_and_a_whole_one_those_of_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(gp, "MOST_SEARCHED", 120)
    inputs, outputs = rows(170)
    few = some_rows(len(outputs), 120)
    rough, of_few, whole = (
        fit_gp(inputs, outputs, rough=True),
        fit_gp(inputs[few], outputs[few], rough=True),
        fit_gp(inputs, outputs),
    )
    assert rough.parameters.log_noise_sd == of_few.parameters.log_noise_sd
    assert len(rough.outputs) == len(outputs)
    of_rough, of_whole = (
        np.abs(log_likelihood_and_gradient(inputs, outputs, fit.parameters)[1]).max() for fit in (rough, whole)
    )
    assert of_whole < 0.1 * of_rough


# --- results that are remembered ---


def test_predictions_are_computed_again_for_other_rows_only() -> None:
    asked = []

    def asked_for(rows: IntArray) -> Array:
        def predicted() -> Array:
            asked.append(rows.tolist())
            return rows.astype(np.float64)

        return remembered.of(predicted, rows)

    remembered: Remembered[Array] = Remembered()
    rows = np.array([0, 0, 1])
    first = asked_for(rows)
    assert asked_for(rows.copy()) is first
    rows[0] = 1  # the caller's array may change
    assert asked_for(rows).tolist() == [1.0, 0.0, 1.0]
    assert asked_for(np.array([0, 0, 1])) is first
    assert asked == [[0, 0, 1], [1, 0, 1]]
    for other in range(2, 6):  # the first is forgotten
        asked_for(np.array([other, other]))
    assert asked_for(np.array([0, 0, 1])) is not first


@pytest.mark.parametrize("rows", [1, MOST_ROWS + 1])
def test_a_planners_single_pushes_and_huge_batches_are_not_remembered(rows: int) -> None:
    remembered: Remembered[Array] = Remembered()
    first, again = (remembered.of(lambda: np.zeros(rows), np.zeros(rows)) for _ in range(2))
    assert first is not again


# --- the kernel and the regularised systems built on it ---


KERNEL = ArdKernel(np.array([0.3, -0.4, 1.0]), 0.2)


def normal(*shape: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=shape)


def test_values_are_the_formula() -> None:
    left, right = normal(4, 3), normal(5, 3, seed=1)
    scaled = (left[:, None] - right) / np.exp(KERNEL.log_lengthscales)
    expected = np.exp(0.4) * np.exp(-0.5 * (scaled**2).sum(axis=2))
    np.testing.assert_allclose(KERNEL.cross(left, right), expected, rtol=1e-14)


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


def test_rejects_matrix_that_is_not_positive_definite() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        cholesky_in_place(np.ones((3, 3)) - 2.0 * np.eye(3))


# --- the exact predictive density ---


def prediction(
    mean: float, variance: float, log_noise: float, log_noise_variance: float, m: int = 1
) -> LatentPrediction:
    return LatentPrediction(*(np.full(m, value) for value in (mean, variance, log_noise, log_noise_variance)))


def normal_density(x: float, mean: float, sd: float) -> float:
    """As scipy.stats has it, which takes a hundred times as long for a single number."""
    return float(np.exp(-0.5 * ((x - mean) / sd) ** 2) / (sd * np.sqrt(2.0 * np.pi)))


def density(at: float, of: LatentPrediction) -> float:
    return float(np.exp(exact_log_density(of, np.array([at]))[0]))


@pytest.mark.parametrize("d", [0.1, 0.5, 1.0, 1.5])
@pytest.mark.parametrize("outcome", [0.3, 1.5, 4.0])
def test_density_equals_adaptive_integration(d: float, outcome: float) -> None:
    def integrand(g: float) -> float:
        return normal_density(outcome, 0.3, np.sqrt(0.05 + np.exp(g))) * normal_density(g, -1.0, d)

    expected, _ = quad(integrand, -1 - 12 * d, -1 + 12 * d, epsabs=1e-14, epsrel=1e-12, limit=400)
    assert density(outcome, prediction(0.3, 0.05, -1.0, d**2)) == pytest.approx(expected, rel=1e-6)


def test_moments_are_those_of_the_matched_gaussian() -> None:
    of = prediction(-0.4, 0.1, -1.5, 0.6)
    moments = [quad(lambda y, k=k: y**k * density(y, of), -25, 25, limit=400, points=[-0.4])[0] for k in range(3)]
    assert moments[0] == pytest.approx(1.0, abs=1e-8)
    assert moments[1] == pytest.approx(-0.4, abs=1e-8)
    assert moments[2] - moments[1] ** 2 == pytest.approx(of.outcome_variance[0], rel=1e-6)


def test_a_known_noise_level_makes_both_densities_the_same() -> None:
    of = prediction(0.2, 0.1, -0.5, 0.0, m=9)
    outcomes = np.linspace(-3, 3, 9)
    np.testing.assert_allclose(exact_log_density(of, outcomes), gaussian_log_density(of, outcomes), atol=1e-12)


# --- noise that is the same everywhere ---


def outcomes(count: int, mean: float, spread: float) -> Array:
    rng = np.random.default_rng(0)
    return np.asarray(np.exp(0.5 * rng.normal(mean, spread, count)) * rng.standard_normal(count))


def summed(seen: Array, mean: float, spread: float) -> float:
    ones = np.ones(len(seen))
    return float(exact_log_density(LatentPrediction(0.0 * ones, 0.0 * ones, mean * ones, spread**2 * ones), seen).sum())


@pytest.mark.parametrize(("mean", "spread"), [(-1.0, 0.8), (2.0, 0.2), (0.5, 1.5)])
def test_density_and_its_derivatives(mean: float, spread: float) -> None:
    seen, step = outcomes(50, -0.5, 1.0), 1e-5
    value, by_mean, by_spread = density_of_constant_noise(seen**2, mean, spread)
    assert value == pytest.approx(summed(seen, mean, spread), rel=1e-12)
    mean_slope = (summed(seen, mean + step, spread) - summed(seen, mean - step, spread)) / (2.0 * step)
    spread_slope = (summed(seen, mean, spread + step) - summed(seen, mean, spread - step)) / (2.0 * step)
    assert by_mean == pytest.approx(mean_slope, rel=1e-6, abs=1e-6)
    assert by_spread == pytest.approx(spread_slope, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("spread", [0.3, 1.0, 3.0])
def test_fit_is_where_density_and_prior_are_highest(spread: float) -> None:
    seen = outcomes(400, -0.5, spread)
    found = fit_constant(np.zeros((400, 1)), seen, heavy_tails=True).parameters

    def score(mean: float, log_spread: float) -> float:
        return summed(seen, mean, min(float(np.exp(log_spread)), 1.5)) - 0.5 * (log_spread / 0.5) ** 2

    best = score(found.noise_mean, float(np.log(found.noise_spread)))
    for mean, log_spread in ((0.02, 0.0), (-0.02, 0.0), (0.0, 0.02), (0.0, -0.02)):
        assert score(found.noise_mean + mean, float(np.log(found.noise_spread)) + log_spread) < best
    assert found.noise_spread <= 1.5 + 1e-12
