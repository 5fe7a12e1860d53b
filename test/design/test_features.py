# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Features of a model: their square is the posterior covariance of its mean function; what pushes add to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from drifting_models import extended, grain, slippery
from drifting_models import pushes as drifting_pushes
from synthetic import noisy_pushes, square_rig

from push_predictor.design.features import NEGLIGIBLE, features_of
from push_predictor.design.information import Information, greedy
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
    np.testing.assert_allclose(found.noise_sd**2, np.diagonal(moments.process_covariance, axis1=1, axis2=2))
    np.testing.assert_allclose(variance, expected, rtol=1e-6, atol=1.1 * NEGLIGIBLE)
    assert variance.max() > 20 * NEGLIGIBLE


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


def test_effects_add_their_common_uncertainty_and_scale_that_of_the_base() -> None:
    base = trained("gp", drifting_pushes(40))
    model = extended(base, slippery(0.1, 0.05), grain(0.1), scale=(2.0, 2.0, 2.0))
    assert isinstance(model.predictor, ExtendedPredictor)
    together = replace(model.predictor, cross={(0, 1): np.array([[4e-4, -3e-4]])})
    covariates = {"elapsed_time": np.full(40, 800.0), "slider_heading": np.linspace(-3.0, 3.0, 40)}
    push = Push(some().inputs, some().duration, covariates)
    alone, found = features_of(base, push), features_of(replace(model, predictor=together), push)
    np.testing.assert_allclose(found.noise_sd, 2.0 * alone.noise_sd)
    uncertainty = together.shift(push).covariance / found.noise_sd[:, :, None] / found.noise_sd[:, None]
    assert uncertainty.max() > NEGLIGIBLE
    np.testing.assert_allclose(squares(found.values), squares(alone.values) + uncertainty, rtol=1e-6, atol=1e-9)
    assert np.abs(together.shift(push).covariance - model.predictor.shift(push).covariance).max() > 0.0


def test_a_textbook_model_has_nothing_to_learn() -> None:
    with pytest.raises(RequestError, match="model: 'analytical'"):
        features_of(trained("analytical"), some())


# --- updates of the posterior by pushes ---


C, K, Q, M = 6, 4, 5, 7


@pytest.fixture
def parts() -> tuple[Array, Array, Array]:
    """Features and noise of candidates, features of what matters."""
    rng = np.random.default_rng(0)
    root = rng.standard_normal((C, K, K))
    return rng.standard_normal((C, K, Q)), root @ root.transpose(0, 2, 1) + np.eye(K), rng.standard_normal((M, Q))


def left_over(parts: tuple[Array, Array, Array], chosen: list[int]) -> Array:
    """Posterior covariance of the weights after the outcomes of some candidates, in information form."""
    features, noise, _ = parts
    precision = np.eye(Q)
    for k in chosen:
        precision += features[k].T @ np.linalg.inv(noise[k]) @ features[k]
    return np.linalg.inv(precision)


def loss(parts: tuple[Array, Array, Array], chosen: list[int]) -> float:
    return float(0.5 * np.mean(np.log1p(variances(parts, chosen))))


def variances(parts: tuple[Array, Array, Array], chosen: list[int]) -> Array:
    return np.asarray(np.diag(parts[2] @ left_over(parts, chosen) @ parts[2].T))


def test_updates_in_turn_equal_conditioning_on_all(parts: tuple[Array, Array, Array]) -> None:
    found = Information(*parts)
    for chosen in ([], [2], [2, 5], [2, 5, 2]):
        for k in chosen[-1:]:
            found.observe(k)
        assert found.variance == pytest.approx(np.mean(variances(parts, chosen)))
        covariance = left_over(parts, chosen)
        np.testing.assert_allclose(found.covariance, parts[0] @ covariance @ parts[0].transpose(0, 2, 1))
        expected = [loss(parts, chosen) - loss(parts, [*chosen, k]) for k in range(C)]
        np.testing.assert_allclose(found.gains(), expected)


def test_the_greedy_batch_takes_the_largest_gain_each_time(parts: tuple[Array, Array, Array]) -> None:
    order, left = greedy(Information(*parts), 4)
    chosen: list[int] = []
    for k, after in zip(order.tolist(), left, strict=True):
        best = min(range(C), key=lambda other: loss(parts, [*chosen, other]))
        assert k == best
        chosen.append(k)
        assert after == pytest.approx(np.mean(variances(parts, chosen)))


def test_the_gain_of_a_candidate_may_count_less(parts: tuple[Array, Array, Array]) -> None:
    gains, factor = Information(*parts).gains(), np.ones(C)
    best = int(np.argmax(gains))
    factor[best] = 0.99 * np.sort(gains)[-2] / gains[best]
    assert greedy(Information(*parts), 1)[0][0] == best
    assert greedy(Information(*parts), 1, factor=lambda order: factor)[0][0] == np.argsort(gains)[-2]


def test_by_how_much_a_gain_counts_may_depend_on_those_chosen_before(parts: tuple[Array, Array, Array]) -> None:
    asked: list[list[int]] = []

    def factor(order: Sequence[int]) -> Array:
        asked.append(list(order))
        return np.ones(C)

    order = greedy(Information(*parts), 3, factor=factor)[0].tolist()
    assert asked == [[], order[:1], order[:2]]


def test_the_batch_begins_with_given_candidates_and_counts_their_outcomes(parts: tuple[Array, Array, Array]) -> None:
    order, left = greedy(Information(*parts), 3, [4, 1])
    assert order[:2].tolist() == [4, 1]
    assert order[2] == min(range(C), key=lambda other: loss(parts, [4, 1, other]))
    assert greedy(Information(*parts), 3, [4, None, 1])[0].tolist() == [
        4,
        min(range(C), key=lambda other: loss(parts, [4, other])),
        1,
    ]
    assert left[1] == pytest.approx(np.mean(variances(parts, [4, 1])))


def test_a_long_batch_can_be_cancelled(parts: tuple[Array, Array, Array]) -> None:
    asked: list[int] = []

    def check_cancelled() -> None:
        asked.append(len(asked))
        if len(asked) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        greedy(Information(*parts), 5, check_cancelled=check_cancelled)
    assert len(asked) == 3
