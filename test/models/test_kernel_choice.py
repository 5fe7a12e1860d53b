# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Matern-5/2 and squared exponential kernels, and a nugget in the noise process: from kernels to tabulated models."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from likelihoods import bound_and_gradient, log_marginal_likelihood
from scipy.special import gamma, kv
from synthetic import noisy_pushes, square_rig

from push_predictor.errors import ModelFileError
from push_predictor.models.gaussian_process.gp import GaussianProcess, GpParameters, fit_gp, log_likelihood_and_gradient
from push_predictor.models.gaussian_process.kernels import (
    DEFAULT_CHOICE,
    FAMILIES,
    KernelChoice,
    KernelFamily,
    Matern52,
    SquaredExponential,
    ard_kernel,
)
from push_predictor.models.gaussian_process.matrices.ridge import RegularisableKernel, factorise
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.models.gaussian_process.vhgp_bound import Bound, VhgpProblem
from push_predictor.models.gaussian_process.vhgp_inner import maximise_over_noise
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.models.push_model import PushModel
from push_predictor.models.store import model_file, regression_record
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.types import Array

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("coarse_integration")]

CHOICES = [KernelChoice(family, nugget) for family, nugget in product(FAMILIES, (False, True))]
KERNEL = Matern52(np.array([0.3, -0.4, 1.0]), 0.2)


def normal(*shape: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=shape)


def rows(n: int, seed: int = 0) -> tuple[Array, Array]:
    """A sine of the first input, with noise whose standard deviation is exp(second input - 1)."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(n, 2))
    return inputs, np.sin(inputs[:, 0]) + rng.normal(size=n) * np.exp(inputs[:, 1] - 1.0)


def parameters(choice: KernelChoice) -> VhgpParameters:
    nugget = -0.8 if choice.noise_nugget else None
    return VhgpParameters(np.array([0.1, -0.2]), 0.2, np.array([0.3, 0.1]), -0.1, -1.0, choice.family, nugget)


# --- the kernel -----------------------------------------------------------------------------------------------------


def test_matern_values_are_those_of_its_definition_by_a_bessel_function() -> None:
    left, right = normal(4, 3), normal(5, 3, seed=1)
    r = np.linalg.norm((left[:, None] - right) / np.exp(KERNEL.log_lengthscales), axis=2)
    scaled = np.sqrt(5.0) * r
    expected = np.exp(0.4) * 2.0**-1.5 / gamma(2.5) * scaled**2.5 * kv(2.5, scaled)
    np.testing.assert_allclose(KERNEL.cross(left, right), expected, rtol=1e-12)


def test_matern_is_quadratic_at_short_and_exponential_at_long_distances() -> None:
    kernel = Matern52(np.zeros(1), 0.0)
    near = kernel.cross(np.zeros((2, 1)), np.array([[1e-3], [2e-3]]))[0]
    assert 1.0 - near == pytest.approx(5.0 / 6.0 * np.array([1e-6, 4e-6]), rel=1e-3)
    far = kernel.cross(np.zeros((2, 1)), np.array([[40.0], [41.0]]))[0]
    assert far[1] / far[0] == pytest.approx(np.exp(-np.sqrt(5.0)), rel=0.06)
    assert far[0] > 1e10 * SquaredExponential(np.zeros(1), 0.0).cross(np.zeros((1, 1)), np.full((1, 1), 40.0))[0, 0]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(-3.0, 3.0), st.floats(-3.0, 1.5), st.sampled_from(FAMILIES))
def test_matrices_are_symmetric_positive_and_at_most_their_diagonal(
    seed: int, log_scale: float, log_sd: float, family: KernelFamily
) -> None:
    kernel = ard_kernel(family, np.full(2, log_scale), log_sd)
    matrix = kernel.matrix(normal(150, 2, seed=seed))  # more rows than a block
    assert (matrix == matrix.T).all()
    assert matrix.max() <= kernel.variance * (1.0 + 1e-14)
    np.testing.assert_allclose(np.diagonal(matrix), kernel.variance, rtol=1e-9)
    assert np.linalg.eigvalsh(matrix).min() > -1e-9 * kernel.variance


def test_one_row_of_matern_equals_that_of_many() -> None:
    left, right = normal(6, 3), normal(140, 3, seed=1)
    alone = [KERNEL.cross(left[i : i + 1], right)[0] for i in range(6)]
    np.testing.assert_allclose(alone, KERNEL.cross(left, right), rtol=1e-12)


def test_infinite_lengthscale_removes_its_input() -> None:
    inputs = normal(20, 3)
    blind, pair = Matern52(np.array([0.3, -0.4, 20.0]), 0.2), Matern52(np.array([0.3, -0.4]), 0.2)
    np.testing.assert_allclose(blind.matrix(inputs), pair.matrix(inputs[:, :2]), rtol=1e-12)


@pytest.mark.parametrize("family", FAMILIES)
def test_kernel_gradient_equals_finite_differences_and_does_not_change_weights(family: KernelFamily) -> None:
    inputs, weights = normal(100, 3), normal(100, 100, seed=1)
    weights = weights + weights.T
    before = weights.copy()

    def contracted(vector: Array) -> float:
        return float((weights * ard_kernel(family, vector[:3], vector[3]).matrix(inputs)).sum())

    at = np.array([0.3, -0.4, 1.0, 0.2])
    kernel = ard_kernel(family, at[:3], at[3])
    gradient = kernel.gradient(inputs, kernel.matrix(inputs), weights)
    assert np.array_equal(weights, before)
    np.testing.assert_allclose(gradient, slopes(contracted, at), rtol=0, atol=1e-9 * np.abs(gradient).max())


# --- regressions ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [60, 250])
def test_the_gradient_of_a_matern_gp_equals_finite_differences(n: int) -> None:
    inputs, outputs = rows(n)

    def value(vector: Array) -> float:
        return log_marginal_likelihood(GaussianProcess(inputs, outputs, of_gp(vector)))

    def of_gp(vector: Array) -> GpParameters:
        return GpParameters(vector[:2], float(vector[2]), float(vector[3]), "matern52")

    at = np.array([0.2, -0.3, 0.1, -1.2])
    found, gradient = log_likelihood_and_gradient(inputs, outputs, of_gp(at))
    assert found == pytest.approx(value(at), abs=1e-8)
    np.testing.assert_allclose(gradient, slopes(value, at), rtol=0, atol=1e-8 * np.abs(gradient).max())


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize(("n", "every"), [(60, 7), (220, 70)])
def test_the_gradient_of_the_bound_equals_finite_differences(choice: KernelChoice, n: int, every: int) -> None:
    inputs, outputs = rows(n)
    sites = np.exp(0.5 * normal(n, seed=1) - 0.7)
    at = np.concatenate([sites, parameters(choice).to_vector()])

    def value(vector: Array) -> float:
        problem = VhgpProblem.of(inputs, outputs, VhgpParameters.from_vector(vector[n:], choice))
        return Bound.tied(problem, vector[:n]).value

    _, of_sites, of_parameters = bound_and_gradient(inputs, outputs, parameters(choice), sites)
    gradient = np.concatenate([of_sites, of_parameters])
    chosen = [*range(0, n, every), *range(n, len(at))]
    scales = np.concatenate([sites, np.ones(len(at) - n)])
    expected = slopes_at(value, at, scales, chosen)
    np.testing.assert_allclose(gradient[chosen], expected, rtol=0, atol=1e-8 * np.abs(gradient).max())


@pytest.mark.parametrize("n", [50, 300])
def test_separate_nugget_equals_nugget_in_the_matrix(n: int) -> None:
    matrix, weights = SquaredExponential(np.full(2, 0.5), 0.1).matrix(normal(n, 2)), np.exp(normal(n, seed=2))
    apart = factorise(matrix, 0.3).regularise(weights)
    inside = RegularisableKernel(matrix + 0.3 * np.eye(n), None).regularise(weights)
    values = normal(n, seed=3)
    np.testing.assert_allclose(apart.precision(), inside.precision(), atol=1e-10)
    np.testing.assert_allclose(apart.residual(values), inside.residual(values), atol=1e-10)
    np.testing.assert_allclose(apart.posterior_diagonal, inside.posterior_diagonal, rtol=1e-8)
    assert apart.log_determinant == pytest.approx(inside.log_determinant, abs=1e-8)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_noise_at_an_input_is_the_conditional_gaussian_with_the_nugget_in_its_variance_only(
    family: KernelFamily,
) -> None:
    inputs, outputs = rows(60)
    chosen = parameters(KernelChoice(family, True))
    best = maximise_over_noise(VhgpProblem.of(inputs, outputs, chosen), None, 1e-12)
    sites, nugget = best.tied_precisions, chosen.nugget
    assert nugget == pytest.approx(np.exp(-1.6))
    for new in (inputs[:5], rows(5, seed=1)[0]):  # at a training input the nugget is a new one, too
        cross = chosen.noise.cross(new, inputs)
        gain = cross @ np.linalg.inv(chosen.noise.matrix(inputs) + nugget * np.eye(60) + np.diag(1.0 / sites))
        prediction = VHGP(inputs, outputs, chosen, sites).predict(new)
        expected = chosen.noise.variance + nugget - (gain * cross).sum(axis=1)
        np.testing.assert_allclose(prediction.log_noise_variance, expected, rtol=1e-9)
        assert (prediction.log_noise_variance > nugget).all()
        np.testing.assert_allclose(prediction.log_noise_mean, -1.0 + cross @ (sites - 0.5), atol=1e-9)


def test_a_vanishing_nugget_changes_nothing() -> None:
    inputs, outputs = rows(60)
    without = parameters(DEFAULT_CHOICE)
    tiny = VhgpParameters.from_vector(np.append(without.to_vector(), -12.0), KernelChoice(noise_nugget=True))
    bounds = [maximise_over_noise(VhgpProblem.of(inputs, outputs, p), None, 1e-12).value for p in (without, tiny)]
    assert bounds[0] == pytest.approx(bounds[1], abs=1e-6)


def test_vector_of_parameters_round_trips() -> None:
    for choice in CHOICES:
        chosen = parameters(choice)
        again = VhgpParameters.from_vector(chosen.to_vector(), choice)
        assert again.choice == choice and np.array_equal(again.to_vector(), chosen.to_vector())
        assert len(chosen.to_vector()) == 7 + choice.noise_nugget


def test_a_kinked_function_is_likelier_under_matern_and_a_smooth_one_under_the_squared_exponential() -> None:
    inputs = normal(150, 1)
    for outputs, better, worse in (
        (np.abs(inputs[:, 0]), "matern52", "squared_exponential"),
        (np.sin(inputs[:, 0]), "squared_exponential", "matern52"),
    ):
        noisy = outputs + 0.01 * normal(150, seed=2)
        likelihood = {f: log_marginal_likelihood(fit_gp(inputs, noisy, KernelChoice(f))) for f in FAMILIES}
        assert likelihood[better] > likelihood[worse] + 2.0


@pytest.mark.parametrize("choice", CHOICES)
def test_every_kernel_choice_recovers_noise_even_from_a_third_of_the_rows(
    choice: KernelChoice,
) -> None:
    model = fit_vhgp(*rows(420), choice)
    assert model.parameters.choice == choice
    new = np.random.default_rng(9).uniform(-1.2, 1.2, size=(200, 2))
    prediction = model.predict(new)
    ratio = np.sqrt(prediction.process_variance) / np.exp(new[:, 1] - 1.0)
    assert np.exp(np.abs(np.log(ratio)).mean()) < 1.3
    assert np.abs(prediction.mean - np.sin(new[:, 0])).mean() < 0.1


# --- models and files -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def models() -> dict[KernelChoice, PushModel]:
    return {
        c: train_model(
            noisy_pushes(60),
            square_rig(),
            "vhgp",
            name="a model",
            options=TrainingOptions(kernels=c, tails=False, mean="zero"),
        )
        for c in CHOICES
    }


@pytest.mark.parametrize("choice", CHOICES)
def test_loaded_model_has_its_kernels(
    models: dict[KernelChoice, PushModel], choice: KernelChoice, tmp_path: Path
) -> None:
    save_model(models[choice], tmp_path / "m")
    loaded, table = load_model(tmp_path / "m"), noisy_pushes(50, seed=2)
    a, b = (m.predict_rows(table.inputs, table.duration) for m in (models[choice], loaded))
    assert np.array_equal(a.mean, b.mean) and np.array_equal(a.covariance, b.covariance)
    assert [r.parameters.choice for r in loaded.predictor.regressions] == [choice] * 3


def independent(model: PushModel) -> PushModel:
    """The model without the correlation of its outputs, which needs a later format."""
    return replace(model, predictor=replace(model.predictor, correlation=None))


def test_a_gp_keeps_its_family(tmp_path: Path) -> None:
    model = train_model(
        noisy_pushes(60),
        square_rig(),
        "gp",
        name="g",
        options=TrainingOptions(kernels=KernelChoice("matern52"), mean="zero"),
    )
    save_model(model, tmp_path / "m")
    loaded = load_model(tmp_path / "m")
    assert [r.parameters.family for r in loaded.predictor.regressions] == ["matern52"] * 3


def test_model_without_new_parts_is_written_in_format_1(models: dict[KernelChoice, PushModel], tmp_path: Path) -> None:
    for choice, model in models.items():
        save_model(independent(model), tmp_path / "m")
        found = header(tmp_path / "m")
        assert found["format_version"] == (1 if choice == DEFAULT_CHOICE else 2)
        assert ("family" in str(found)) == (choice.family == "matern52")
        assert ("nugget" in str(found)) == choice.noise_nugget


def test_an_older_reader_refuses_other_kernels_by_their_version(
    models: dict[KernelChoice, PushModel], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(model_file, "FORMAT_VERSION", 1)
    for choice, model in models.items():
        save_model(independent(model), tmp_path / "m")
        if choice == DEFAULT_CHOICE:
            load_model(tmp_path / "m")
        else:
            with pytest.raises(ModelFileError, match=r"version 2.*reads up to version 1: update it"):
                load_model(tmp_path / "m")


def test_rejects_unknown_kernel_family(
    models: dict[KernelChoice, PushModel], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_model(models[KernelChoice("matern52")], tmp_path / "m")
    monkeypatch.setattr(regression_record, "FAMILIES", ("squared_exponential",))
    with pytest.raises(ModelFileError, match="kernel family 'matern52' is not accepted, give one of"):
        load_model(tmp_path / "m")


@pytest.mark.parametrize("choice", CHOICES)
def test_tabulated_model_is_accurate_with_or_without_a_table(
    models: dict[KernelChoice, PushModel], choice: KernelChoice
) -> None:
    answers, table = tabulate(models[choice]), noisy_pushes(60)
    tabulated, exact = (m.predict_rows(table.inputs, table.duration) for m in (answers, models[choice]))
    sd = np.sqrt(np.diagonal(exact.covariance, axis1=1, axis2=2))
    assert np.max(np.abs(tabulated.mean - exact.mean) / sd) < 1e-3
    ratio = np.diagonal(tabulated.covariance, axis1=1, axis2=2) / sd**2
    assert np.max(np.abs(ratio - 1.0)) < 1e-2
    assert answers.tabulated or answers.how.startswith("exact")


def header(path: Path) -> dict[str, object]:
    with np.load(path) as archive:
        found = json.loads(archive["header"].tobytes())
    return dict(found)


def slopes(function: Callable[[Array], float], at: Array) -> Array:
    return slopes_at(function, at, np.ones(len(at)), range(len(at)))


def slopes_at(function: Callable[[Array], float], at: Array, scales: Array, chosen: Iterable[int]) -> Array:
    """Derivatives by central differences of fourth order, with steps of a thousandth of the scales."""
    found = []
    for i in chosen:
        h = np.zeros_like(at)
        h[i] = 1e-3 * scales[i]
        near, far = function(at + h) - function(at - h), function(at + 2 * h) - function(at - 2 * h)
        found.append((8.0 * near - far) / (12.0 * h[i]))
    return np.array(found)
