# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sparse VHGP: fit, prediction, held-out rows, grids, files, and as a push model."""

from __future__ import annotations

import tracemalloc
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from sparse_rows import PARAMETERS, rows
from synthetic import square_rig

from push_predictor.errors import TrainingError
from push_predictor.models import train
from push_predictor.models.gaussian_process import sparse_vhgp as sparse_fit
from push_predictor.models.gaussian_process.inducing import inducing_rows
from push_predictor.models.gaussian_process.sparse_vhgp import DEFAULT_INDUCING, SparseVHGP, fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.tabulated.grid_posterior import GridRegression, on_grid
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import MOST_DENSE_ROWS, TrainingOptions, inducing_inputs, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

MANY = 1200  # rows: more than a dense model takes


@cache
def dense_and_sparse(n: int) -> tuple[VHGP, SparseVHGP]:
    """The same hyperparameters and sites; enough inducing inputs to determine all rows."""
    inputs, outputs = rows(n)
    dense = fit_vhgp(inputs, outputs)
    chosen = inducing_rows(dense.parameters.signal, inputs, n), inducing_rows(dense.parameters.noise, inputs, n)
    return dense, SparseVHGP(inputs, outputs, dense.parameters, dense.site_precisions, *chosen)


@pytest.fixture(scope="module")
def fitted() -> SparseVHGP:
    return fit_sparse_vhgp(*rows(MANY), 30)


def test_fit_recovers_input_dependent_noise(fitted: SparseVHGP) -> None:
    new = np.random.default_rng(9).uniform(-1.2, 1.2, size=(200, 2))
    prediction = fitted.predict(new)
    ratio = np.sqrt(prediction.process_variance) / np.exp(new[:, 1] - 1.0)
    assert np.exp(np.abs(np.log(ratio)).mean()) < 1.1
    assert np.abs(prediction.mean - np.sin(new[:, 0])).mean() < 0.03


def test_predictions_equal_those_of_a_dense_model() -> None:
    dense, sparse = dense_and_sparse(300)
    new = rows(50, seed=3)[0]
    one, other = dense.predict(new), sparse.predict(new)
    np.testing.assert_allclose(other.mean, one.mean, atol=2e-4)
    np.testing.assert_allclose(other.outcome_variance, one.outcome_variance, rtol=2e-3)
    np.testing.assert_allclose(other.log_noise_variance, one.log_noise_variance, rtol=1e-2, atol=1e-4)


def test_rows_beyond_the_dense_limit_improve_the_model(fitted: SparseVHGP) -> None:
    inputs, outputs = rows(MANY)
    new, truth = rows(500, seed=5)[0], np.sin(rows(500, seed=5)[0][:, 0])
    dense: VHGP = fit_vhgp(inputs[:300], outputs[:300])
    error, of_dense = (np.mean((m.predict(new).mean - truth) ** 2) for m in (fitted, dense))
    assert error < 0.5 * of_dense


@pytest.mark.slow
def test_the_same_rows_give_the_same_model() -> None:
    one, again = (fit_sparse_vhgp(*rows(150), 10) for _ in range(2))
    new = rows(20, seed=4)[0]
    np.testing.assert_array_equal(again.predict(new).mean, one.predict(new).mean)
    np.testing.assert_array_equal(again.inducing_noise, one.inducing_noise)


def test_held_out_predictions_equal_those_of_a_dense_model() -> None:
    dense, sparse = dense_and_sparse(300)
    block = np.random.default_rng(0).integers(0, 40, size=300)
    of_dense, of_sparse = dense.held_out(block), sparse.held_out(block)
    for name in ("mean", "variance", "log_noise_mean", "log_noise_variance"):
        np.testing.assert_allclose(getattr(of_sparse, name), getattr(of_dense, name), atol=1e-4, err_msg=name)


def test_held_out_prediction_does_not_depend_on_the_row_itself() -> None:
    """A wrong value moves the prediction at its row, but not the held-out one."""
    _, sparse = dense_and_sparse(300)
    wrong = sparse.outputs.copy()
    wrong[7] += 3.0
    chosen = sparse.inducing_signal, sparse.inducing_noise
    shifted = SparseVHGP(sparse.inputs, wrong, sparse.parameters, sparse.site_precisions, *chosen)
    one, other = (model.held_out(np.arange(300)).mean[7] for model in (sparse, shifted))
    assert one == pytest.approx(other, abs=1e-9)
    assert "solved" not in vars(shifted)  # (n, m) matrices
    assert shifted.predict(sparse.inputs[7:8]).mean[0] > sparse.predict(sparse.inputs[7:8]).mean[0] + 1e-3


def test_grid_posterior_equals_predictions(fitted: SparseVHGP) -> None:
    regression = on_grid(fitted)
    assert isinstance(regression, GridRegression)
    axes = np.linspace(-1.0, 1.0, 7), np.linspace(-1.5, 1.0, 5)
    points = fitted.predict(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2))
    assert regression.noise is not None
    for posterior, prior, mean, variance in (
        (regression.signal, 0.0, points.mean, points.variance),
        (regression.noise, regression.log_noise, points.log_noise_mean, points.log_noise_variance),
    ):
        scale = np.exp(posterior.kernel.log_lengthscales)
        factors = [
            np.exp(-0.5 * ((axis[:, None] - posterior.inputs[:, d]) / scale[d]) ** 2) for d, axis in enumerate(axes)
        ]
        found = posterior.moments(factors)
        np.testing.assert_allclose(found[0].ravel() + prior, mean, atol=1e-9)
        np.testing.assert_allclose(found[1].ravel(), variance, rtol=1e-7)


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


@pytest.mark.slow
@pytest.mark.parametrize("outputs", [np.zeros(40), np.eye(40)[3] * 30.0])
def test_degenerate_outputs_still_give_finite_predictions(outputs: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sparse_fit, "_MOST_ITERATIONS", 6)  # an outlier takes all that are allowed
    inputs = np.random.default_rng(0).normal(size=(40, 2))
    prediction = fit_sparse_vhgp(inputs, outputs, 8).predict(inputs)
    assert np.isfinite(prediction.mean).all() and np.isfinite(prediction.outcome_variance).all()


def test_repeated_inputs_are_accepted() -> None:
    inputs, outputs = rows(300)
    inputs = inputs[np.arange(300) // 20 * 20]
    assert np.isfinite(fit_sparse_vhgp(inputs, outputs, 30).bound)


def test_rejects_unusable_rows() -> None:
    with pytest.raises(TrainingError, match="NaN"):
        fit_sparse_vhgp(np.zeros((5, 2)), np.array([0.0, np.nan, 0.0, 0.0, 0.0]))


def table(n: int) -> PushTable:
    """Pushes of five windows each, with noise that grows with the angle."""
    rng = np.random.default_rng(0)
    inputs = np.column_stack([np.full(n, 0.02), rng.uniform(0.0, 0.25, n), rng.uniform(-0.5, 0.5, n)])
    noise = rng.normal(size=(n, 3)) * np.exp(2.0 * inputs[:, 2:] - 1.0)
    outcomes = 1e-3 * (np.column_stack([np.cos(inputs[:, 2]), np.sin(inputs[:, 2]), inputs[:, 1]]) + noise)
    return PushTable(inputs, np.full(n, 0.2), outcomes, np.array([f"push-{k // 5}" for k in range(n)]))


def test_many_windows_or_given_inducing_inputs_make_a_sparse_model() -> None:
    assert inducing_inputs("vhgp", MOST_DENSE_ROWS) is None
    assert inducing_inputs("vhgp", MOST_DENSE_ROWS + 1) == DEFAULT_INDUCING
    assert inducing_inputs("vhgp", 100, 30) == 30
    assert inducing_inputs("analytical", 100_000) is None
    for kind, wanted in (("gp", 30), ("analytical", 30), ("vhgp", 0)):
        with pytest.raises(TrainingError, match=f"inducing: {wanted} is not accepted"):
            inducing_inputs(kind, 100, wanted)


@pytest.mark.slow
def test_sparse_push_model_of_many_windows_is_trained_saved_loaded_and_tabulated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = table(400)
    monkeypatch.setattr(train, "MOST_DENSE_ROWS", 399)
    monkeypatch.setattr(train, "DEFAULT_INDUCING", 20)
    model = train_model(rows, square_rig(), "vhgp", name="sparse", options=TrainingOptions(n_train=400, mean="zero"))
    assert isinstance(model.predictor, GaussianProcessPredictor)
    assert all(isinstance(regression, SparseVHGP) for regression in model.predictor.regressions)
    save_model(model, tmp_path / "sparse.pushmodel")
    again = load_model(tmp_path / "sparse.pushmodel")
    push = rows.inputs[:40], rows.duration[:40]
    np.testing.assert_array_equal(again.predict_rows(*push).covariance, model.predict_rows(*push).covariance)
    tabulated = tabulate(again)
    assert tabulated.tabulated, tabulated.how
    variance = np.diagonal(model.predict_rows(*push).covariance, axis1=1, axis2=2)
    of_table = np.diagonal(tabulated.predict_rows(*push).covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(of_table, variance, rtol=1e-2)
    truth = 1e-6 * np.exp(4.0 * rows.inputs[:40, 2] - 2.0)
    assert np.exp(np.abs(np.log(variance[:, 0] / truth)).mean()) < 1.4
