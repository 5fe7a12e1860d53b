# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The posteriors that the authors of the method's use on pushing stored, reproduced and surpassed.

Their signal kernel has a constant exp(-2 t3) besides the squared exponential, so the posterior is computed here
from their kernel matrix by the function that our own model uses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from mit_square_fits import fit_scaled, load_square
from scipy.interpolate import RBFInterpolator

from push_predictor.models.gaussian_process.bound import JITTER
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.prediction import LatentPrediction, exact_log_density
from push_predictor.models.gaussian_process.ridge import DenseKernel, DenseRidge
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
@pytest.mark.parametrize("n", [100, 500])
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


@pytest.mark.parametrize(("n", "slack"), [(100, 0.03), pytest.param(500, 0.0, marks=pytest.mark.long)])
def test_trained_on_the_same_rows_our_density_is_as_good(measured_data: Path, n: int, slack: float) -> None:
    square, reference = load_square(measured_data), load_reference(measured_data, n)
    # The reference has dy to the right.
    inputs, outcomes = square.inputs[~square.subset[n]], square.outputs[~square.subset[n]] * [1, -1, 1]
    theirs = -sum(
        exact_log_density(reference[output].predict(inputs), outcomes[:, i]).mean() for i, output in enumerate(OUTPUTS)
    )
    training = np.column_stack([reference[output].train_y for output in OUTPUTS])
    ours = fit_scaled(reference["dx"].train_x, training, "vhgp").scores(inputs, outcomes)
    assert ours.exact_nlpd <= theirs + slack
