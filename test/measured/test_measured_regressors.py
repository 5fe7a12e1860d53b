# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Regressors on the measured square: the posterior of the published VHGP, our density next to it, and scikit-learn.

The reference's signal kernel has a constant exp(-2 t3) besides the squared exponential, so the posterior is computed
here from its kernel matrix by the function that our own model uses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from push_predictor.models.gaussian_process.bound import JITTER
from push_predictor.models.gaussian_process.gp import GaussianProcess, GpParameters
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.prediction import LatentPrediction, exact_log_density, gaussian_log_density
from push_predictor.models.gaussian_process.ridge import DenseKernel, DenseRidge
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.types import Array

OUTPUTS = ("dx", "dy", "dtheta")


@dataclass(frozen=True)
class Reference:
    """One stored output: their fields, and their posterior with the noise recovered from alpha."""

    fields: dict[str, Array]
    train_x: Array
    train_y: Array

    @property
    def kernel(self) -> ArdKernel:
        return ArdKernel(self.fields["theta1"][:2], float(self.fields["theta1"][2]))

    @property
    def constant(self) -> float:
        return float(np.exp(-2.0 * self.fields["theta1"][3]))

    @property
    def prior_variance(self) -> float:
        return self.kernel.variance * (1.0 + JITTER) + self.constant

    def cross(self, scaled: Array) -> Array:
        return self.kernel.cross(scaled, self.fields["X"]) + self.constant

    def ridge(self) -> DenseRidge:
        matrix = self.cross(self.fields["X"])
        matrix.flat[:: len(matrix) + 1] += JITTER * self.kernel.variance
        theirs = DenseKernel(self.kernel, self.fields["X"])
        theirs.__dict__["matrix"] = matrix
        return theirs.regularise(self.fields["alpha"] / (self.train_y - matrix @ self.fields["alpha"]))

    def explained(self, cross: Array) -> Array:
        return np.asarray(np.square(self.ridge().explained(cross)).sum(axis=0))

    def predict(self, inputs: Array) -> LatentPrediction:
        """At new inputs; g is interpolated between the training inputs, where alone it was stored."""
        scaled = inputs / np.exp(self.fields["lengthscales"])
        cross = self.cross(scaled)
        variance = self.prior_variance - self.explained(cross)
        stored = np.column_stack([self.fields["mutst"], np.log(self.fields["diagSigmatst"])])
        noise = RBFInterpolator(self.fields["X"], stored, kernel="cubic")(scaled)
        return LatentPrediction(cross @ self.fields["alpha"], variance, noise[:, 0], np.exp(noise[:, 1]))


@cache
def load_reference(folder: Path, n: int) -> dict[str, Reference]:
    with np.load(folder / "mit_square" / f"vhgp_reference_N{n}.npz") as file:
        return {
            output: Reference(
                {key.split("__")[1]: file[key] for key in file.files if key.startswith(f"{output}__")},
                file["train_x"],
                file["train_y"][:, i],
            )
            for i, output in enumerate(OUTPUTS)
        }


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("n", [100, 500, 1000])
def test_the_stored_posterior_is_reproduced(measured_data: Path, n: int, output: str) -> None:
    reference = load_reference(measured_data, n)[output]
    fields, ridge = reference.fields, reference.ridge()
    cross = reference.cross(fields["X"])
    mean = cross @ ridge.residual(ridge.weights * reference.train_y)
    variance = reference.prior_variance - reference.explained(cross)
    np.testing.assert_allclose(mean, fields["Ey_test"], rtol=1e-10, atol=1e-10 * np.abs(mean).max())
    np.testing.assert_allclose(variance, fields["diagCtst"], rtol=1e-8)
    whole = LatentPrediction(mean, variance, fields["mutst"], fields["diagSigmatst"])
    np.testing.assert_allclose(whole.outcome_variance, fields["Vy_test"], rtol=1e-8)


def standard(values: Array, like: Array) -> Array:
    """Columns with the mean 0 and the deviation 1 that those of `like` then have."""
    return np.asarray((values - like.mean(axis=0)) / like.std(axis=0))


@pytest.mark.parametrize(("n", "slack"), [(100, 0.03), pytest.param(500, 0.0, marks=pytest.mark.long)])
def test_trained_on_the_same_rows_our_density_is_as_good(measured_data: Path, n: int, slack: float) -> None:
    reference = load_reference(measured_data, n)
    with np.load(measured_data / "mit_square" / "pushes_3500.npz") as file:
        other = ~file[f"in_subset_{n}"]
        inputs, outcomes = (np.column_stack([file[name] for name in names])[other]
                            for names in (("c", "beta"), OUTPUTS))  # fmt: skip
    theirs, ours = 0.0, 0.0
    for output, observed in zip(OUTPUTS, outcomes.T, strict=True):
        one = reference[output]
        theirs -= exact_log_density(one.predict(inputs), observed).mean()
        model = fit_vhgp(standard(one.train_x, one.train_x), standard(one.train_y, one.train_y))
        predicted = model.predict(standard(inputs, one.train_x))
        density = exact_log_density(predicted, standard(observed, one.train_y)).mean()
        ours += float(np.log(one.train_y.std()) - density)
    assert ours <= theirs + slack


def test_gp_equals_scikit_learn_given_its_hyperparameters(measured_data: Path) -> None:
    from sklearn.gaussian_process import GaussianProcessRegressor  # here: it would take each worker 0.8 s
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    one = load_reference(measured_data, 100)["dx"]
    x, y = standard(one.train_x, one.train_x), standard(one.train_y, one.train_y)
    known, new = np.arange(len(x)) % 3 > 0, np.arange(len(x)) % 3 == 0
    kernel = ConstantKernel(1.0) * RBF([1.0, 1.0]) + WhiteKernel(0.1)
    theirs = GaussianProcessRegressor(kernel, alpha=0.0).fit(x[known], y[known])
    mean, sd = theirs.predict(x[new], return_std=True)
    log_variance, *log_lengthscales, log_noise = theirs.kernel_.theta
    parameters = GpParameters(np.array(log_lengthscales), log_variance / 2, log_noise / 2)
    ours = GaussianProcess(x[known], y[known], parameters).predict(x[new])
    nlpd = 0.5 * (np.log(2 * np.pi * sd**2) + ((y[new] - mean) / sd) ** 2).mean()
    assert -gaussian_log_density(ours, y[new]).mean() == pytest.approx(nlpd, abs=1e-6)
    np.testing.assert_allclose(ours.mean, mean, atol=1e-7)
    np.testing.assert_allclose(ours.outcome_variance, sd**2, rtol=1e-6)
