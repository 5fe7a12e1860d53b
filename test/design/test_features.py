# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Features of a model: their square is the posterior covariance of its mean function, in units of noise."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from drifting_models import extended, grain, slippery
from drifting_models import pushes as drifting_pushes
from synthetic import noisy_pushes, square_rig

from push_predictor.design.features import NEGLIGIBLE, features_of
from push_predictor.errors import RequestError
from push_predictor.models.mechanics.fitted import DIFFERENCE, FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.predictors import ExtendedPredictor, GaussianProcessPredictor, MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.types import Array

pytestmark = pytest.mark.slow

TABLE = noisy_pushes(36)


def trained(kind: str, table: PushTable = TABLE, **options: Any) -> PushModel:
    return train_model(table, square_rig(), kind, name=kind, options=TrainingOptions(**{"mean": "zero", **options}))


@cache
def learnt(kind: str) -> PushModel:
    """Trained once for all tests."""
    return trained(kind)


def fitted() -> FittedMechanics:
    """Mechanics with two parameters that are not quite certain."""
    rig = square_rig()
    values = {"contact_friction": 0.25, "centre_x": 0.003}
    covariance = np.diag([2e-3, 1e-6])
    return FittedMechanics(PushMechanics(rig.outline, rig.pusher_radius), values, covariance)


def some(count: int = 40, seed: int = 3) -> Push:
    """Pushes at speeds between those of the training."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(0.025, 0.035, count), rng.random(count), rng.uniform(-1.0, 1.0, count)])
    return Push(inputs, np.full(count, 0.2), {})


def squares(values: Array) -> Array:
    """Covariance (n, 3, 3) of the outcomes of each push."""
    return values @ values.transpose(0, 2, 1)


@pytest.mark.parametrize("kind", ["gp", "vhgp"])
def test_a_learnt_model_has_the_variance_of_its_functions(kind: str) -> None:
    model, push = learnt(kind), some()
    found = features_of(model, push)
    moments = model.predictor.moments(push)
    of_function = moments.covariance - moments.process_covariance
    expected = np.diagonal(of_function, axis1=1, axis2=2) / found.noise_sd**2
    variance = np.sum(found.values**2, axis=2)
    np.testing.assert_allclose(variance, expected, rtol=1e-6, atol=1.1 * NEGLIGIBLE)
    assert variance.max() > 20 * NEGLIGIBLE


def test_noise_is_that_of_the_process() -> None:
    model, push = learnt("vhgp"), some()
    process = model.predict_rows(push.inputs, push.duration).process_covariance
    np.testing.assert_allclose(features_of(model, push).noise_sd ** 2, np.diagonal(process, axis1=1, axis2=2))


def test_the_outputs_of_functions_have_weights_of_their_own() -> None:
    values = features_of(learnt("gp"), some()).values
    assert np.all(np.count_nonzero(np.any(values != 0.0, axis=0), axis=0) == 1)


def test_pushes_far_apart_share_little_and_equal_pushes_all() -> None:
    push = some()
    same = Push(np.concatenate([push.inputs, push.inputs]), np.full(80, 0.2), {})
    values = features_of(learnt("gp"), same).values[:, 0]
    covariance = values @ values.T
    np.testing.assert_allclose(covariance[:40, :40], covariance[:40, 40:], atol=2 * NEGLIGIBLE)


@pytest.mark.long
def test_a_prior_model_has_about_the_variance_of_its_draws() -> None:
    model, push = trained("prior", empty_table()), some()
    found, moments = features_of(model, push), model.predictor.moments(push)
    drawn = (moments.covariance - moments.process_covariance) / found.noise_sd[:, :, None] / found.noise_sd[:, None]
    ratio = squares(found.values).mean(axis=0) / drawn.mean(axis=0)
    np.testing.assert_allclose(np.diagonal(ratio), 1.0, atol=0.25)


def test_features_of_the_mechanics_are_derivatives_by_the_parameters() -> None:
    model, push, mechanics = trained("analytical"), some(10), fitted()
    for k, name in enumerate(mechanics.values):
        one = np.zeros_like(mechanics.covariance)
        one[k, k] = 1e-4
        alone = replace(mechanics, covariance=one)
        found = features_of(replace(model, predictor=MechanicsPredictor(alone, model.predictor.covariance)), push)
        ends = within(name, mechanics.values[name])
        low, high = (
            mechanics.shifted((name,), np.full((10, 1), end - mechanics.values[name]), push)[0] for end in ends
        )
        slope = 0.01 * (high - low) / (ends[1] - ends[0]) / found.noise_sd
        along = found.values[:, :, np.argmax(np.abs(found.values).sum(axis=(0, 1)))]
        np.testing.assert_allclose(np.abs(along), np.abs(slope), atol=1e-3 * np.abs(slope).max())


def within(name: str, value: float) -> tuple[float, float]:
    """Values below and above, in the plausible range."""
    known = BY_NAME[name]
    return max(value - DIFFERENCE * known.spread, known.low), min(value + DIFFERENCE * known.spread, known.high)


def test_residuals_and_mechanics_add_up() -> None:
    model, push = trained("gp", about=fitted()), some()
    assert isinstance(model.predictor, GaussianProcessPredictor) and model.predictor.mean is not None
    mean = model.predictor.mean
    certain = replace(mean, covariance=0.0 * mean.covariance)
    residual = features_of(replace(model, predictor=replace(model.predictor, mean=certain)), push)
    both = features_of(model, push)
    of_mechanics = squares(both.values[:, :, residual.values.shape[2] :])
    assert of_mechanics.max() > 0.0
    np.testing.assert_allclose(squares(both.values), squares(residual.values) + of_mechanics, atol=1e-9)
    moments = model.predictor.moments(push)
    np.testing.assert_allclose(both.noise_sd**2, np.diagonal(moments.process_covariance, axis1=1, axis2=2))
    of_function = np.diagonal(moments.covariance - moments.process_covariance, axis1=1, axis2=2)
    variance = np.sum(residual.values**2, axis=2)
    np.testing.assert_allclose(variance, of_function / both.noise_sd**2, atol=1.1 * NEGLIGIBLE)
    assert variance.max() > 5 * NEGLIGIBLE


def test_an_effect_adds_its_uncertainty_and_scales_that_of_the_base() -> None:
    table = drifting_pushes(40)
    base = trained("gp", table)
    model = extended(base, slippery(0.1, 0.05), scale=(2.0, 2.0, 2.0))
    push = Push(*(some().inputs, some().duration), {"elapsed_time": np.full(40, 800.0)})
    alone, found = features_of(base, push), features_of(model, push)
    np.testing.assert_allclose(found.noise_sd, 2.0 * alone.noise_sd)
    uncertainty = model.predictor.shift(push).covariance / found.noise_sd[:, :, None] / found.noise_sd[:, None]
    assert uncertainty.max() > NEGLIGIBLE
    np.testing.assert_allclose(squares(found.values), squares(alone.values) + uncertainty, rtol=1e-6, atol=1e-9)


def test_effects_that_were_estimated_together_share_their_uncertainty() -> None:
    base = trained("gp", drifting_pushes(40))
    model = extended(base, slippery(0.1, 0.05), grain(0.1))
    assert isinstance(model.predictor, ExtendedPredictor)
    together = replace(model.predictor, cross={(0, 1): np.array([[4e-4, -3e-4]])})
    covariates = {"elapsed_time": np.full(40, 800.0), "slider_heading": np.linspace(-3.0, 3.0, 40)}
    push = Push(some().inputs, some().duration, covariates)
    found = features_of(replace(model, predictor=together), push)
    units = found.noise_sd[:, :, None] * found.noise_sd[:, None]
    expected = squares(features_of(base, push).values) + together.shift(push).covariance / units
    np.testing.assert_allclose(squares(found.values), expected, rtol=1e-6, atol=1e-9)
    assert np.abs(together.shift(push).covariance - model.predictor.shift(push).covariance).max() > 0.0


def test_a_textbook_model_has_nothing_to_learn() -> None:
    with pytest.raises(RequestError, match="model: 'analytical'"):
        features_of(trained("analytical"), some())
