# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The VHGP, dense and sparse: its bound, its gradient, fits that recover input-dependent noise, and as a push model."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from functools import cache
from importlib import import_module

import numpy as np
import pytest
from likelihoods import bound_and_gradient, log_marginal_likelihood
from sparse_rows import PARAMETERS, rows

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process import sparse_vhgp, vhgp
from push_predictor.models.gaussian_process.bound import Bound, Sites, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.fit import _spread as prior_spread
from push_predictor.models.gaussian_process.fit import maximise_bound, maximise_over_noise
from push_predictor.models.gaussian_process.gp import SHORTEST, GaussianProcess, GpParameters, some_rows
from push_predictor.models.gaussian_process.inducing import InducedKernel, inducing_rows
from push_predictor.models.gaussian_process.sparse_vhgp import (
    DEFAULT_INDUCING,
    SparseVHGP,
    fit_sparse_vhgp,
    noise_prior,
)
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.models.train import MOST_DENSE_ROWS, inducing_inputs
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


def test_a_bound_that_is_not_finite_is_refused() -> None:
    inputs, outputs = rows(20)
    problem = VhgpProblem.of(inputs, outputs, PARAMETERS)
    with pytest.raises(FloatingPointError, match="not finite"), np.errstate(all="ignore"):
        Bound.at(problem, Sites(np.ones(20), np.full(20, -1e200)))


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


@pytest.mark.parametrize(
    ("fit", "n", "of_noise", "of_mean"),
    [(fit_vhgp, 250, 1.3, 0.1), (lambda inputs, outputs: fit_sparse_vhgp(inputs, outputs, 30), 1200, 1.1, 0.03)],
    ids=["dense", "sparse"],
)
def test_fit_recovers_input_dependent_noise(fit: Callable[..., VHGP], n: int, of_noise: float, of_mean: float) -> None:
    new = np.random.default_rng(9).uniform(-1.2, 1.2, size=(200, 2))
    prediction = fit(*rows(n)).predict(new)
    ratio = np.sqrt(prediction.process_variance) / np.exp(new[:, 1] - 1.0)
    assert np.exp(np.abs(np.log(ratio)).mean()) < of_noise
    assert np.abs(prediction.mean - np.sin(new[:, 0])).mean() < of_mean


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


def test_matrices_are_freed_and_computed_again() -> None:
    model = VHGP(*rows(30), PARAMETERS, np.full(30, 0.5))
    new = rows(5, seed=1)[0]
    before = model.predict(new).variance
    assert "matrix" not in vars(model.solved.problem.signal) and "matrix" not in vars(model.solved.problem.noise)
    model.free_matrices()
    assert not {"solved", "functions"} & vars(model).keys()
    np.testing.assert_array_equal(model.predict(new).variance, before)


# --- with inducing inputs --------------------------------------------------------------------------------------------


def problem(n: int, signal: int, noise: int, parameters: VhgpParameters = PARAMETERS) -> VhgpProblem:
    """With the first `signal` rows for inducing inputs of f, the last `noise` for those of g."""
    inputs, outputs = rows(n)
    of_signal = InducedKernel.of(parameters.signal, inputs, inputs[:signal])
    of_noise = InducedKernel.of(parameters.noise, inputs, inputs[n - noise :])
    return VhgpProblem(outputs, parameters, of_signal, of_noise)


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


# --- the model ---


@cache
def dense_and_sparse(n: int) -> tuple[VHGP, SparseVHGP]:
    """The same hyperparameters and sites; enough inducing inputs to determine all rows."""
    inputs, outputs = rows(n)
    dense = fit_vhgp(inputs, outputs)
    chosen = inducing_rows(dense.parameters.signal, inputs, n), inducing_rows(dense.parameters.noise, inputs, n)
    return dense, SparseVHGP(inputs, outputs, dense.parameters, dense.site_precisions, *chosen)


def test_predictions_equal_those_of_a_dense_model_also_of_held_out_rows() -> None:
    dense, sparse = dense_and_sparse(300)
    new = rows(50, seed=3)[0]
    one, other = dense.predict(new), sparse.predict(new)
    np.testing.assert_allclose(other.mean, one.mean, atol=2e-4)
    np.testing.assert_allclose(other.outcome_variance, one.outcome_variance, rtol=2e-3)
    np.testing.assert_allclose(other.log_noise_variance, one.log_noise_variance, rtol=1e-2, atol=1e-4)
    block = np.random.default_rng(0).integers(0, 40, size=300)
    of_dense, of_sparse = dense.held_out(block), sparse.held_out(block)
    for name in ("mean", "variance", "log_noise_mean", "log_noise_variance"):
        np.testing.assert_allclose(getattr(of_sparse, name), getattr(of_dense, name), atol=1e-4, err_msg=name)
    assert "solved" not in vars(sparse)  # (n, m) matrices


def test_memory_grows_with_rows_times_inducing_inputs() -> None:
    inputs, outputs = rows(20_000)
    chosen = np.arange(0, 20_000, 400)
    tracemalloc.start()
    try:
        SparseVHGP(inputs, outputs, PARAMETERS, np.full(20_000, 0.5), chosen, chosen)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 3.0 * 8 * 20_000 * len(chosen)  # features of f and of g, and blocks


def test_many_windows_or_given_inducing_inputs_make_a_sparse_model() -> None:
    assert inducing_inputs("vhgp", MOST_DENSE_ROWS) is None
    assert inducing_inputs("vhgp", MOST_DENSE_ROWS + 1) == DEFAULT_INDUCING
    assert inducing_inputs("vhgp", 100, 30) == 30
    assert inducing_inputs("analytical", 100_000) is None
    for kind, wanted in (("gp", 30), ("analytical", 30), ("vhgp", 0)):
        with pytest.raises(TrainingError, match=f"inducing: {wanted} is not accepted"):
            inducing_inputs(kind, 100, wanted)
