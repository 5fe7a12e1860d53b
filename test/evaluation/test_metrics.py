# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Metrics, splits and normal scores by their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.special import ndtri
from scipy.stats import multivariate_normal, norm, rankdata

from push_predictor.evaluation.metrics import coverage, gaussian_nlpd, joint_nlpd, nmse, standardised
from push_predictor.evaluation.splits import FOLDS, push_bootstrap, push_folds, split_by_push
from push_predictor.normal_scores import normal_scores
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.types import Array

RNG = np.random.default_rng(0)
OUTCOMES = RNG.standard_normal((400, 3)) * [1e-3, 2e-3, 0.05]
SD = np.array([1e-3, 2e-3, 0.05])


def pushes(sizes: list[int]) -> PushTable:
    push_id = np.repeat([f"p{k}" for k in range(len(sizes))], sizes)
    n = len(push_id)
    return PushTable(np.full((n, 3), 0.1), np.full(n, 0.2), np.zeros((n, 3)), push_id)


def test_training_mean_has_an_nmse_of_one_per_output() -> None:
    mean = np.array([1e-3, 0.0, 0.01])
    assert nmse(np.tile(mean, (400, 1)), OUTCOMES, mean) == pytest.approx(np.ones(3))
    assert nmse(OUTCOMES, OUTCOMES, mean) == pytest.approx(np.zeros(3))


def test_nmse_of_a_constant_outcome_is_nan() -> None:
    assert np.isnan(nmse(np.ones((3, 1)), np.zeros((3, 1)), np.zeros(1))[0])


def test_nlpd_equals_the_negative_log_density() -> None:
    mean, variance = np.zeros((400, 3)), np.tile(SD**2, (400, 1))
    assert gaussian_nlpd(mean, variance, OUTCOMES) == pytest.approx(-norm.logpdf(OUTCOMES, 0.0, SD))


def test_units_shift_nlpd_by_the_logarithm_of_their_ratio() -> None:
    scale = np.array([1e3, 1e3, 1.0])
    mean, variance = np.zeros((400, 3)), np.tile(SD**2, (400, 1))
    in_si = gaussian_nlpd(mean, variance, OUTCOMES).sum(axis=1)
    in_mm = gaussian_nlpd(mean * scale, variance * scale**2, OUTCOMES * scale).sum(axis=1)
    assert in_mm - in_si == pytest.approx(np.full(400, 2.0 * np.log(1000.0)))


def test_joint_density_of_independent_outputs_is_the_product() -> None:
    mean, variance = np.zeros((400, 3)), np.tile(SD**2, (400, 1))
    product = gaussian_nlpd(mean, variance, OUTCOMES).sum(axis=1)
    assert joint_nlpd(mean, np.tile(np.diag(SD**2), (400, 1, 1)), OUTCOMES) == pytest.approx(product)


def test_joint_density_of_correlated_outputs_equals_scipy() -> None:
    root = np.diag(SD) @ np.array([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [-0.3, 0.2, 1.0]])
    covariance = root @ root.T
    expected = -multivariate_normal(np.zeros(3), covariance).logpdf(OUTCOMES)
    assert joint_nlpd(np.zeros((400, 3)), np.tile(covariance, (400, 1, 1)), OUTCOMES) == pytest.approx(expected)


def test_standardised_residuals_of_a_correct_model_have_unit_covariance() -> None:
    root = np.array([[1.0, 0.0, 0.0], [0.8, 0.5, 0.0], [0.1, -0.4, 0.2]])
    outcomes = np.random.default_rng(1).standard_normal((20_000, 3)) @ root.T
    z = standardised(np.zeros_like(outcomes), np.tile(root @ root.T, (len(outcomes), 1, 1)), outcomes)
    assert np.cov(z.T) == pytest.approx(np.eye(3), abs=0.04)


@pytest.mark.parametrize("level", [0.5, 0.9, 0.95])
def test_coverage_of_a_correct_model_equals_the_level(level: float) -> None:
    outcomes = np.random.default_rng(2).standard_normal((20_000, 2))
    half = np.full(2, norm.ppf(0.5 + level / 2.0))
    shares = coverage(np.zeros_like(outcomes), np.ones_like(outcomes), outcomes, half)
    assert shares == pytest.approx(np.full(2, level), abs=0.012)


@given(sizes=st.lists(st.integers(1, 9), min_size=2, max_size=30), seed=st.integers(0, 99))
def test_every_split_keeps_pushes_whole(sizes: list[int], seed: int) -> None:
    table = pushes(sizes)
    splits = [push_folds(table, 5, seed), *push_bootstrap(table.push_id, seed, 3)]
    for labels in splits:
        for push in table.pushes:
            assert len(set(labels[table.push_id == push].tolist())) == 1


@given(sizes=st.lists(st.integers(1, 9), min_size=5, max_size=30))
def test_folds_have_equal_numbers_of_pushes(sizes: list[int]) -> None:
    table = pushes(sizes)
    folds = push_folds(table, 5)
    counts = [len(set(table.push_id[folds == k].tolist())) for k in range(5)]
    assert max(counts) - min(counts) <= 1


def test_split_by_push_tests_every_row_once_and_never_trains_on_tested_pushes() -> None:
    table = pushes([3, 1, 4, 1, 5, 9, 2, 6])
    splits = [split_by_push(table, fold) for fold in range(FOLDS)]
    assert np.sort(np.concatenate([s.test for s in splits])).tolist() == list(range(len(table)))
    for s in splits:
        assert sorted([*s.training, *s.test]) == list(range(len(table)))
        assert not set(table.push_id[s.training].tolist()) & set(table.push_id[s.test].tolist())


def test_folds_do_not_depend_on_the_order_of_rows() -> None:
    """As docs/results/accuracy.md tells: default_rng(0).permutation(pushes) % 5, push 9 before push 10."""
    numbers = np.random.default_rng(3).permutation(np.repeat(np.arange(23), 2))
    n = len(numbers)
    table = PushTable(np.full((n, 3), 0.1), np.full(n, 0.2), np.zeros((n, 3)), numbers.astype(np.str_))
    dealt = (np.random.default_rng(0).permutation(23) % 5)[numbers]
    for fold in range(FOLDS):
        split = split_by_push(table, fold)
        assert split.test.tolist() == np.flatnonzero(dealt == fold).tolist()
        expected = np.random.default_rng(fold).permutation(np.flatnonzero(dealt != fold))
        assert split.first(7).tolist() == expected[:7].tolist()


def test_bootstrap_draws_as_many_pushes_as_there_are() -> None:
    table = pushes([1, 5, 2, 7])
    first_rows = [table.push_id.tolist().index(push) for push in table.pushes]
    assert np.all(push_bootstrap(table.push_id)[:, first_rows].sum(axis=1) == 4)


def test_concatenated_tables_keep_common_covariates() -> None:
    one, other = pushes([2]), pushes([3])
    one.covariates.update(a=np.zeros(2), b=np.ones(2))
    other.covariates.update(b=np.zeros(3))
    both = concatenate([one, other])
    assert len(both) == 5 and list(both.covariates) == ["b"]


FEW_VALUES = st.integers(-3, 3).map(float)  # so that many are equal


@given(arrays(np.float64, array_shapes(min_dims=1, max_dims=2, min_side=1, max_side=20), elements=FEW_VALUES))
def test_normal_scores_are_those_of_average_ranks(values: Array):
    np.testing.assert_allclose(normal_scores(values), ndtri((rankdata(values, axis=0) - 0.5) / len(values)))


def test_column_with_nan_has_no_scores():
    scores = normal_scores(np.array([[1.0, 1.0], [np.nan, 2.0], [3.0, np.inf]]))
    assert np.isnan(scores[:, 0]).all()
    np.testing.assert_allclose(scores[:, 1], ndtri([1 / 6, 1 / 2, 5 / 6]), atol=1e-15)


def test_normal_scores_depend_on_order_only():
    values = np.random.default_rng(0).standard_normal((30, 3))
    assert np.array_equal(normal_scores(values), normal_scores(np.exp(values)))
