# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The VHGP: its bound, its gradient, and fits that recover input-dependent noise."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from importlib import import_module

import numpy as np
import pytest
from likelihoods import bound_and_gradient, log_marginal_likelihood
from sparse_rows import PARAMETERS, rows

from push_predictor.models.gaussian_process import sparse_vhgp, vhgp
from push_predictor.models.gaussian_process.bound import Bound, Sites, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.fit import _sites as sites_from
from push_predictor.models.gaussian_process.fit import _spread as prior_spread
from push_predictor.models.gaussian_process.fit import maximise_bound, maximise_over_noise, precisions_from
from push_predictor.models.gaussian_process.gp import SHORTEST, GaussianProcess, GpParameters, some_rows
from push_predictor.models.gaussian_process.sparse_vhgp import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.types import Array


@pytest.fixture(scope="module")
def fitted() -> VHGP:
    return fit_vhgp(*rows(250))


@pytest.mark.parametrize(("n", "every"), [(60, 1), (220, 40)])
def test_gradient_of_every_parameter_equals_finite_differences(n: int, every: int) -> None:
    """Of 60 rows all, of 220 some of the sites and all hyperparameters."""
    assert PARAMETERS.count == len(PARAMETERS.to_vector())
    inputs, outputs = rows(n)
    sites = np.exp(0.5 * np.random.default_rng(1).normal(size=n) - 0.7)
    at = np.concatenate([sites, PARAMETERS.to_vector()])

    def value(vector: Array) -> float:
        problem = VhgpProblem.of(inputs, outputs, VhgpParameters.from_vector(vector[n:]))
        return Bound.tied(problem, vector[:n]).value

    _, of_sites, of_parameters = bound_and_gradient(inputs, outputs, PARAMETERS, sites)
    gradient = np.concatenate([of_sites, of_parameters])
    scales = np.concatenate([sites, np.ones(8)])
    for i in [*range(0, n, every), *range(n, n + 8)]:
        h = np.zeros_like(at)
        h[i] = 1e-3 * scales[i]
        near, far = value(at + h) - value(at - h), value(at + 2 * h) - value(at - 2 * h)
        expected = (8.0 * near - far) / (12.0 * h[i])
        assert gradient[i] == pytest.approx(expected, abs=1e-8 * np.abs(gradient).max())


def log_normal(at: Array, covariance: Array) -> Array:
    """Log densities (n,) of Gaussians with mean zero and covariances (n, 2, 2) or (1, 2, 2)."""
    at = np.broadcast_to(at, (max(len(covariance), np.size(at) // 2), 2))
    away = np.linalg.solve(covariance, at[..., None])[..., 0]
    return np.asarray(-0.5 * np.sum(at * away, axis=1) - 0.5 * np.log(np.linalg.det(2.0 * np.pi * covariance)))


def test_the_bound_is_below_the_marginal_likelihood_and_near_it() -> None:
    inputs, outputs = np.array([[0.0], [0.8]]), np.array([0.4, -0.9])
    parameters = VhgpParameters(np.zeros(1), 0.0, np.zeros(1), -0.9, -1.0, -1.2)
    signal = parameters.signal.matrix(inputs)
    noise = parameters.noise.matrix(inputs) + parameters.nugget * np.eye(2)

    nodes, weights = np.polynomial.legendre.leggauss(60)  # of each of the two log variances, from -4.5 to 2.5
    g = np.stack(np.meshgrid(3.5 * nodes - 1.0, 3.5 * nodes - 1.0, indexing="ij"), axis=-1).reshape(-1, 2)
    covariance = signal + np.exp(g)[:, None] * np.eye(2) + parameters.jitter * np.eye(2)
    joint = log_normal(outputs, covariance) + log_normal(g + 1.0, noise[None])
    evidence = np.log(np.outer(weights, weights).ravel() @ np.exp(joint) * 3.5**2)
    bound = maximise_over_noise(VhgpProblem.of(inputs, outputs, parameters), None, 1e-12).value
    assert evidence - 0.1 < bound < evidence


def test_bound_with_fixed_noise_is_the_homoscedastic_likelihood() -> None:
    inputs, outputs = rows(60)
    parameters = VhgpParameters(PARAMETERS.log_lengthscales, 0.2, np.zeros(2), -9.0, -1.0, -9.0)
    problem = VhgpProblem.of(inputs, outputs, parameters)
    jittered = 0.5 * np.log(np.exp(-1.0) + parameters.jitter)
    gp = GaussianProcess(inputs, outputs, GpParameters(PARAMETERS.log_lengthscales, 0.2, jittered))
    assert maximise_over_noise(problem, None, 1e-12).value == pytest.approx(log_marginal_likelihood(gp), abs=1e-3)


def test_no_other_q_of_the_noise_has_a_higher_bound() -> None:
    inputs, outputs = rows(60)
    problem = VhgpProblem.of(inputs, outputs, PARAMETERS)
    best = maximise_over_noise(problem, None, 1e-13)
    rng = np.random.default_rng(3)
    for size in (1e-3, 1e-2, 1e-1, 1.0):
        precisions = best.sites.precisions * np.exp(size * rng.normal(size=60))
        potentials = best.sites.potentials + size * rng.normal(size=60)
        assert Bound.at(problem, Sites(precisions, potentials)).value < best.value


def test_q_at_the_maximum_has_one_parameter_per_row() -> None:
    problem = VhgpProblem.of(*rows(60), PARAMETERS)
    best = maximise_over_noise(problem, None, 1e-13)
    np.testing.assert_allclose(best.mean_weights, best.sites.precisions - 0.5, atol=1e-5)
    np.testing.assert_allclose(best.signal.optimal_precisions, best.sites.precisions, atol=1e-5)
    assert Bound.tied(problem, best.sites.precisions).value == pytest.approx(best.value, abs=1e-8)


def test_q_of_a_loose_search_has_one_parameter_per_row() -> None:
    problem = VhgpProblem.of(*rows(250), PARAMETERS)
    loose = maximise_over_noise(problem, None, 1e-4)
    best = maximise_over_noise(problem, None, 1e-12).value
    tied = Bound.tied(problem, loose.tied_precisions)
    np.testing.assert_allclose(tied.noise_mean, loose.noise_mean, atol=1e-9)
    assert best - 1e-3 < loose.value <= best + 1e-9
    assert best - 1e-3 < tied.value <= best + 1e-9


def test_search_for_q_ends_sooner_far_from_the_goal() -> None:
    problem = VhgpProblem.of(*rows(60), PARAMETERS)
    best = maximise_over_noise(problem, None, 1e-12).value
    near, far = (maximise_over_noise(problem, None, 1e-12, goal=best + gap).value for gap in (0.0, 50.0))
    assert near == pytest.approx(best, abs=1e-6)
    assert best - 1.0 < far < best - 1e-6


@pytest.mark.slow
def test_fit_needs_less_memory_than_six_dense_matrices() -> None:
    inputs, outputs = rows(400)
    import_module("scipy.optimize")  # the first fit imports it: 10 MB that are no matrices
    tracemalloc.start()
    try:
        fit_vhgp(inputs, outputs, most_iterations=3)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 6 * 8 * 400**2


def test_search_for_q_converges_from_any_start() -> None:
    inputs, outputs = rows(80)
    elsewhere = VhgpParameters(np.array([1.0, 0.5]), -0.5, np.array([-1.0, 0.8]), 0.7, 1.5, 0.2)
    start = maximise_over_noise(VhgpProblem.of(inputs, outputs, elsewhere), None, 1e-3).sites
    problem = VhgpProblem.of(inputs, outputs, PARAMETERS)
    fresh, warm = (maximise_over_noise(problem, where, 1e-12) for where in (None, start))
    assert warm.value == pytest.approx(fresh.value, abs=1e-8)


def test_fit_recovers_input_dependent_noise(fitted: VHGP) -> None:
    new = np.random.default_rng(9).uniform(-1.2, 1.2, size=(200, 2))
    prediction = fitted.predict(new)
    ratio = np.sqrt(prediction.process_variance) / np.exp(new[:, 1] - 1.0)
    assert np.exp(np.abs(np.log(ratio)).mean()) < 1.3
    assert np.abs(prediction.mean - np.sin(new[:, 0])).mean() < 0.1


def test_prediction_far_from_data_is_the_prior(fitted: VHGP) -> None:
    far = fitted.predict(np.array([[1e6, 1e6]]))
    parameters = fitted.parameters
    assert far.mean[0] == pytest.approx(0.0, abs=1e-9)
    assert far.variance[0] == pytest.approx(parameters.signal.variance, rel=1e-5)
    assert far.log_noise_mean[0] == pytest.approx(parameters.noise_mean)
    assert far.log_noise_variance[0] == pytest.approx(parameters.noise.variance + parameters.nugget)


def test_variances_stay_positive_at_and_between_noiseless_rows() -> None:
    inputs = np.random.default_rng(0).normal(size=(120, 2))
    model = fit_vhgp(inputs, np.sin(inputs[:, 0]))
    prediction = model.predict(np.concatenate([inputs, 0.5 * (inputs[1:] + inputs[:-1])]))
    assert (prediction.variance > 0.0).all() and (prediction.log_noise_variance > 0.0).all()
    assert np.isfinite(prediction.outcome_variance).all()
    assert np.abs(prediction.mean[:120] - model.outputs).max() < 1e-2


@pytest.mark.parametrize("fit", [fit_vhgp, lambda inputs, outputs: fit_sparse_vhgp(inputs, outputs, 8)])
@pytest.mark.parametrize("outputs", [np.zeros(40), np.sign(np.arange(40) - 20.0), np.eye(40)[3] * 30.0, rows(40)[1]])
def test_degenerate_outputs_and_repeated_inputs_have_finite_predictions(
    fit: Callable[..., VHGP], outputs: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sparse_vhgp, "_MOST_ITERATIONS", 6)  # an outlier takes all that are allowed
    inputs = np.random.default_rng(0).normal(size=(40, 2))[np.arange(40) // 4 * 4]
    prediction = fit(inputs, outputs).predict(inputs)
    assert np.isfinite(prediction.mean).all() and np.isfinite(prediction.outcome_variance).all()


def test_priors_of_the_noise_lengthscales_keep_their_weight_in_a_row_from_a_hundred_rows_on() -> None:
    few, hundred, many = (prior_spread(2, n) for n in (50, 100, 900))
    np.testing.assert_array_equal(few, hundred)
    np.testing.assert_allclose(many / hundred, [1.0, 1.0, 1.0, 1.0 / 3.0, 1.0 / 3.0, 1.0, 1.0, 1.0])
    np.testing.assert_array_equal(hundred[3:5], [0.5, 0.5])


def test_the_noise_at_an_input_is_the_conditional_gaussian_with_the_nugget_in_its_variance_only() -> None:
    inputs, outputs = rows(60)
    best = maximise_over_noise(VhgpProblem.of(inputs, outputs, PARAMETERS), None, 1e-12)
    sites, nugget, kernel = best.tied_precisions, PARAMETERS.nugget, PARAMETERS.noise
    assert nugget == pytest.approx(np.exp(-1.6))
    for new in (inputs[:5], rows(5, seed=1)[0]):  # at a training input the nugget is a new one, too
        cross = kernel.cross(new, inputs)
        gain = cross @ np.linalg.inv(kernel.matrix(inputs) + nugget * np.eye(60) + np.diag(1.0 / sites))
        prediction = VHGP(inputs, outputs, PARAMETERS, sites).predict(new)
        expected = kernel.variance + nugget - (gain * cross).sum(axis=1)
        np.testing.assert_allclose(prediction.log_noise_variance, expected, rtol=1e-9)
        assert (prediction.log_noise_variance > nugget).all()
        np.testing.assert_allclose(prediction.log_noise_mean, -1.0 + cross @ (sites - 0.5), atol=1e-9)


def test_a_rough_fit_of_more_rows_has_the_hyperparameters_of_some_and_a_whole_one_those_of_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(vhgp, "MOST_SEARCHED", 40)
    inputs, outputs = rows(170)
    few = some_rows(len(outputs), 40)
    start = GpParameters(np.zeros(2), 0.0, -0.7)
    part = fit_vhgp(inputs[few], outputs[few], start=start, most_iterations=3)
    rough = fit_vhgp(inputs, outputs, start=start, most_iterations=3, rough=True)
    np.testing.assert_array_equal(rough.parameters.to_vector(), part.parameters.to_vector())
    best = maximise_over_noise(VhgpProblem.of(inputs, outputs, rough.parameters), None, 1e-10).value
    assert best - 0.05 < rough.bound <= best + 1e-9
    whole = fit_vhgp(inputs, outputs, start=start)
    from_the_prior, _ = maximise_bound(inputs, outputs, start, 40, SHORTEST)
    np.testing.assert_allclose(whole.parameters.to_vector(), from_the_prior.to_vector(), atol=0.05)
    of_some, _ = maximise_bound(inputs[few], outputs[few], start, 40, SHORTEST)
    assert np.abs(of_some.to_vector() - from_the_prior.to_vector()).max() > 0.2


def test_the_noise_of_all_rows_begins_where_some_rows_predict_it(fitted: VHGP) -> None:
    inputs, outputs = rows(400, seed=7)
    problem = VhgpProblem.of(inputs, outputs, fitted.parameters)
    best = maximise_over_noise(problem, None, 1e-6).value
    begun = Bound.at(problem, sites_from(problem, fitted.predict(inputs))).value
    cold = Bound.tied(problem, np.full(400, 0.5)).value
    assert best - begun < 0.1 * (best - cold)
    precisions = precisions_from(problem, fitted.predict(inputs))
    assert Bound.tied(problem, precisions).value == pytest.approx(best, abs=0.05)


def test_matrices_are_freed_and_computed_again() -> None:
    model = VHGP(*rows(30), PARAMETERS, np.full(30, 0.5))
    new = rows(5, seed=1)[0]
    before = model.predict(new).variance
    assert "matrix" not in vars(model.solved.problem.signal) and "matrix" not in vars(model.solved.problem.noise)
    model.free_matrices()
    assert not {"solved", "functions"} & vars(model).keys()
    np.testing.assert_array_equal(model.predict(new).variance, before)
