# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Learning curves on the measured square: VHGP against GP, and our GP against scikit-learn's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from likelihoods import log_marginal_likelihood
from mit_square_fits import fit_scaled, load_square, mean_scores, random_split

from push_predictor.models.gaussian_process.gp import GaussianProcess, GpParameters
from push_predictor.models.gaussian_process.prediction import gaussian_log_density
from push_predictor.types import Array


@pytest.mark.long
def test_vhgp_has_a_better_density_than_gp_on_the_random_split(measured_data: Path) -> None:
    """By 0.12 of 100 rows: test_measured_paper."""
    gp = mean_scores(measured_data, "random", "gp", 500, 1)
    vhgp = mean_scores(measured_data, "random", "vhgp", 500, 1)
    assert vhgp.nlpd <= gp.nlpd - 0.25
    assert vhgp.exact_nlpd < vhgp.nlpd


@pytest.mark.parametrize(
    ("split", "n", "seeds", "nmse", "nlpd"),
    [
        ("random", 500, 1, 0.115, -17.83),
        ("push", 100, 5, 0.197, -17.09),
    ],
)
def test_gp_scores_what_the_reference_scores(
    measured_data: Path, split: str, n: int, seeds: int, nmse: float, nlpd: float
) -> None:
    gp = mean_scores(measured_data, split, "gp", n, seeds)
    assert gp.nmse == pytest.approx(nmse, abs=0.002)
    assert gp.nlpd == pytest.approx(nlpd, abs=0.02)


def fitted_by_scikit_learn(inputs: Array, outputs: Array) -> Any:
    """Imported here: it would take each worker of the tests 0.8 s."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel(1.0) * RBF([1.0, 1.0]) + WhiteKernel(0.1)
    return GaussianProcessRegressor(kernel, alpha=0.0).fit(inputs, outputs)


def test_gp_equals_scikit_learn_given_its_hyperparameters(measured_data: Path) -> None:
    square = load_square(measured_data)
    training, test = random_split(100, 0)
    x, y = square.inputs[training], square.outputs[training]
    scaled = (x - x.mean(axis=0)) / x.std(axis=0)
    new = (square.inputs[test] - x.mean(axis=0)) / x.std(axis=0)
    for k in range(3):
        outputs = (y[:, k] - y[:, k].mean()) / y[:, k].std()
        expected = (square.outputs[test, k] - y[:, k].mean()) / y[:, k].std()
        theirs = fitted_by_scikit_learn(scaled, outputs)
        mean, sd = theirs.predict(new, return_std=True)
        log_variance, *log_lengthscales, log_noise = theirs.kernel_.theta
        parameters = GpParameters(np.array(log_lengthscales), log_variance / 2, log_noise / 2)
        ours = GaussianProcess(scaled, outputs, parameters).predict(new)
        nlpd = 0.5 * (np.log(2 * np.pi * sd**2) + ((expected - mean) / sd) ** 2).mean()
        assert -gaussian_log_density(ours, expected).mean() == pytest.approx(nlpd, abs=1e-6)
        np.testing.assert_allclose(ours.mean, mean, atol=1e-7)
        np.testing.assert_allclose(ours.outcome_variance, sd**2, rtol=1e-6)


def test_gp_finds_as_good_a_likelihood_as_scikit_learn(measured_data: Path) -> None:
    square = load_square(measured_data)
    training, _ = random_split(200, 0)
    fitted = fit_scaled(square.inputs[training], square.outputs[training], "gp")
    for ours in fitted.models:
        theirs = fitted_by_scikit_learn(ours.inputs, ours.outputs)
        assert isinstance(ours, GaussianProcess)
        assert log_marginal_likelihood(ours) >= theirs.log_marginal_likelihood_value_ - 0.01
