# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The correlation of the outputs: its properties at all inputs, and a fit that finds it only if it exists."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from learnt_models import learnt
from synthetic import square_rig

from push_predictor.evaluation.metrics import joint_nlpd
from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.predictors import correlation as correlation_module
from push_predictor.models.predictors.correlation import (
    FEWEST_PUSHES,
    LONGEST,
    Correlation,
    correlated,
    fit_correlation,
)
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

PER_PUSH = 4


def pushes(n: int, seed: int, strength: float) -> PushTable:
    """Smooth outcomes with noise whose correlation of dx and dtheta is strength times the sign of the angle."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([np.full(n, 0.02), rng.uniform(0.0, 0.25, n), rng.uniform(-1.0, 1.0, n)])
    noise = rng.standard_normal((n, 3))
    along = strength * np.sign(inputs[:, 2])
    noise[:, 2] = along * noise[:, 0] + np.sqrt(1.0 - along**2) * noise[:, 2]
    mean = np.column_stack([4e-3 * np.cos(inputs[:, 2]), 2e-3 * np.sin(inputs[:, 2]), 0.1 * (inputs[:, 1] - 0.12)])
    push_id = np.array([f"p{k // PER_PUSH}" for k in range(n)])
    return PushTable(inputs, np.full(n, 0.2), mean + noise * [2e-4, 2e-4, 4e-3], push_id)


def trained(kind: str = "gp", strength: float = 0.8, n: int = 300) -> PushModel:
    return train_model(
        pushes(n, 0, strength), square_rig(), kind, name="a", options=TrainingOptions(tails=False, mean="zero")
    )


trained_once = cache(trained)


def correlation_of(model: PushModel) -> Correlation:
    found = learnt(model).correlation
    assert found is not None
    return found


def alone(model: PushModel) -> GaussianProcessPredictor:
    """Its predictor with independent outputs."""
    return replace(learnt(model), correlation=None)


def with_fitted_correlation(model: PushModel) -> GaussianProcessPredictor:
    """Its predictor with a correlation that is fitted again."""
    return replace(alone(model), correlation=fit_correlation(alone(model).regressions, model.training.push_id))


def of(model: PushModel, inputs: Array) -> Array:
    """The correlation (n,) of dx and dtheta that a model's process has."""
    c = model.predict_rows(inputs, np.full(len(inputs), 0.2)).process_covariance
    return np.asarray(c[:, 0, 2] / np.sqrt(c[:, 0, 0] * c[:, 2, 2]))


@pytest.fixture(scope="module")
def model() -> PushModel:
    return trained_once("gp")


# --- properties at all inputs -------------------------------------------------------------------------------

moderate = st.floats(-4.0, 4.0)


@given(
    features=arrays(float, (12, 2), elements=moderate),
    residuals=arrays(float, (12, 3), elements=moderate),
    asked=arrays(float, (5, 2), elements=st.floats(-1e6, 1e6)),
    bandwidth=st.floats(0.05, 5.0),
    shrinkage=st.floats(0.1, 100.0),
)
def test_correlation_is_a_correlation_matrix_everywhere(
    features: Array, residuals: Array, asked: Array, bandwidth: float, shrinkage: float
) -> None:
    found = Correlation(features, residuals, bandwidth, shrinkage).at(np.concatenate([asked, features]))
    assert np.array_equal(found, found.transpose(0, 2, 1))
    assert np.all(np.diagonal(found, axis1=1, axis2=2) == 1.0)
    assert np.all(np.linalg.eigvalsh(found) > 0.0)


def test_outputs_are_independent_far_from_training_rows(model: PushModel) -> None:
    correlation = correlation_of(model)
    far = np.array([[1e3, 0.0], [0.0, -1e3], [1e9, 1e9]])
    assert np.array_equal(correlation.at(far), np.broadcast_to(np.eye(3), (3, 3, 3)))
    assert np.all(correlation.at(correlation.features[:0]).shape == np.array((0, 3, 3)))


def test_correlation_equals_that_of_many_nearby_rows() -> None:
    rng, r = np.random.default_rng(0), np.array([[1.0, 0.5, -0.6], [0.5, 1.0, 0.1], [-0.6, 0.1, 1.0]])
    z = rng.multivariate_normal(np.zeros(3), r, 20_000)
    found = Correlation(rng.standard_normal((20_000, 2)) * 0.1, z, 1.0, 2.0).at(np.zeros((1, 2)))[0]
    assert found == pytest.approx(r, abs=0.03)


# --- fit -------------------------------------------------------------------------------------------------


def test_a_correlation_that_changes_its_sign_is_found(model: PushModel) -> None:
    angles = np.array([-0.8, -0.5, 0.5, 0.8])
    inputs = np.column_stack([np.full(4, 0.02), np.full(4, 0.12), angles])
    assert of(model, inputs) == pytest.approx(0.8 * np.sign(angles), abs=0.25)


def test_correlation_increases_likelihood_of_new_pushes(model: PushModel) -> None:
    new = pushes(400, 1, 0.8)
    with_it, plain = (m.predict_rows(new.inputs, new.duration) for m in (model, replace(model, predictor=alone(model))))
    gain = joint_nlpd(plain.mean, plain.covariance, new.outcomes) - joint_nlpd(
        with_it.mean, with_it.covariance, new.outcomes
    )
    assert 0.35 < gain.mean() < -0.5 * np.log(1.0 - 0.8**2) + 0.1  # what one would gain who knew the correlation
    assert np.array_equal(with_it.mean, plain.mean)
    for ours, theirs in (
        (with_it.covariance, plain.covariance),
        (with_it.process_covariance, plain.process_covariance),
    ):
        assert np.diagonal(ours, axis1=1, axis2=2) == pytest.approx(np.diagonal(theirs, axis1=1, axis2=2), rel=1e-12)


@pytest.mark.slow
def test_no_correlation_is_fitted_to_independent_outputs() -> None:
    model = trained(strength=0.0, n=120)
    scaling, found = learnt(model).scaling, 0
    for seed in range(14):
        table = pushes(120, seed, 0.0)
        features = scaling.features(model.rig.outline, table.inputs)
        scaled = (table.outcomes - scaling.outcome_mean) / scaling.outcome_sd
        regressions = tuple(
            GaussianProcess(features, column, r.parameters)
            for r, column in zip(learnt(model).regressions, scaled.T, strict=True)
            if isinstance(r, GaussianProcess)
        )
        found += fit_correlation(regressions, table.push_id) is not None
    assert found <= 1


def test_no_correlation_is_fitted_to_too_few_pushes() -> None:
    assert learnt(trained(n=(FEWEST_PUSHES - 1) * PER_PUSH)).correlation is None


def test_residuals_are_bounded_by_their_expected_length(model: PushModel) -> None:
    lengths = np.linalg.norm(correlation_of(model).residuals, axis=1)
    assert lengths.max() == pytest.approx(LONGEST, rel=1e-6) and lengths.min() < 1.0


# --- held out -------------------------------------------------------------------------------------------------------


def test_held_out_correlation_is_that_of_the_other_blocks(model: PushModel) -> None:
    correlation, block = correlation_of(model), np.arange(len(model.training)) // PER_PUSH % 5
    found = correlation.held_out(correlation.features, block)
    for number in range(5):
        out = block == number
        others = Correlation(
            correlation.features[~out], correlation.residuals[~out], correlation.bandwidth, correlation.shrinkage
        )
        assert found[out] == pytest.approx(others.at(correlation.features[out]), abs=1e-12)


def test_correlation_keeps_a_sample_of_many_rows(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(correlation_module, "MOST_ROWS", 150)
    monkeypatch.setattr(correlation_module, "MOST_BLOCKS", 30)
    whole = trained_once("gp")
    model = replace(whole, predictor=with_fitted_correlation(whole))
    correlation = correlation_of(model)
    assert correlation.rows is not None and len(correlation.features) == 150
    assert of(model, np.array([[0.02, 0.12, 0.6]]))[0] > 0.5
    save_model(model, tmp_path / "m")
    found = correlation_of(load_model(tmp_path / "m"))
    everywhere, block = learnt(model).regressions[0].inputs, np.arange(len(model.training)) // PER_PUSH
    assert np.array_equal(found.held_out(everywhere, block), correlation.held_out(everywhere, block))
    own = correlation.rows[7]
    others = block[correlation.rows] != block[own]
    expected = replace(correlation, features=correlation.features[others], residuals=correlation.residuals[others])
    assert found.held_out(everywhere, block)[own] == pytest.approx(expected.at(everywhere[[own]])[0], abs=1e-12)


def test_held_out_moments_include_the_correlation(model: PushModel) -> None:
    correlation, block = correlation_of(model), np.arange(len(model.training)) // PER_PUSH
    mean, total, process = model.held_out_moments(block)
    plain = replace(model, predictor=alone(model)).held_out_moments(block)
    assert np.array_equal(mean, plain[0])
    sd = np.sqrt(np.diagonal(plain[2], axis1=1, axis2=2))
    assert process == pytest.approx(correlated(sd, correlation.held_out(correlation.features, block)), rel=1e-9)
    assert np.all(np.linalg.eigvalsh(total - process) > 0.0)
    assert np.abs(total[:, 0, 2]).max() > 0.0
