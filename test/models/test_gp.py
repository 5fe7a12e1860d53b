# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The homoscedastic Gaussian process: Bayes' rule, its limits and its fit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from likelihoods import log_marginal_likelihood
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
from push_predictor.models.gaussian_process.prediction import MOST_ROWS, Remembered
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


def test_gradient_of_likelihood_vanishes_at_the_fit() -> None:
    fitted = fit_gp(*rows(100))
    _, gradient = log_likelihood_and_gradient(fitted.inputs, fitted.outputs, fitted.parameters)
    inside = np.append(fitted.parameters.log_lengthscales < 6.8, [True, True])
    assert np.abs(gradient[inside]).max() < 0.05


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
