# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Metrics, sums by push, splits and normal scores by their definitions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.special import ndtri
from scipy.stats import multivariate_normal, norm, rankdata

from push_predictor.evaluation.metrics import COVERAGE_LEVELS, coverage, gaussian_nlpd, joint_nlpd, nmse, standardised
from push_predictor.evaluation.push_scores import pooled, push_scores
from push_predictor.evaluation.splits import FOLDS, push_bootstrap, push_folds, split_by_push
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.normal_scores import normal_scores
from push_predictor.recordings.table import OUTPUTS, PushTable, concatenate
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


# --- push scores ------------------------------------------------------------------------------------------------------


SIZES = (1, 4, 2, 7, 3, 5)
SCALE = np.array([1e-3, 1e-3, 0.05])


def comparison(sizes: tuple[int, ...] = SIZES, exact: bool = True, seed: int = 0) -> Comparison:
    """Predictions of n windows that are wrong by about their sd; pushes in no order of their names."""
    rng = np.random.default_rng(seed)
    push_id = np.repeat([f"push-{9 - k}" for k in range(len(sizes))], sizes)
    n = len(push_id)
    mean, observed = SCALE * rng.standard_normal((n, 3)), SCALE * rng.standard_normal((n, 3))
    covariance = np.array([np.diag(SCALE * rng.uniform(0.5, 2.0, 3)) ** 2 for _ in range(n)])
    density = rng.standard_normal((n, 3)) if exact else None
    return Comparison("made up", 10, push_id, mean, covariance, observed, density, np.zeros(3))


def rows_of(c: Comparison, rows: np.ndarray) -> Comparison:
    fields = {name: getattr(c, name)[rows] for name in ("push_id", "mean", "covariance", "observed")}
    return replace(c, **fields, exact_log_density=None if c.exact_log_density is None else c.exact_log_density[rows])


def test_totals_equal_the_json() -> None:
    c = comparison()
    totals, expected_json = push_scores(c).totals(), metrics_json(c)
    for name in ("nmse", "nlpd", "exact_nlpd"):
        assert getattr(totals, name)[0] == pytest.approx([expected_json[name][output] for output in OUTPUTS], rel=1e-12)
    for k, level in enumerate(COVERAGE_LEVELS):
        json_shares = [expected_json["coverage"][str(level)][output] for output in OUTPUTS]
        assert totals.coverage[0, :, k] == pytest.approx(json_shares, rel=1e-12)


def test_resampled_totals_give_the_interval_of_the_json() -> None:
    c = comparison()
    draws, expected_json = push_scores(c).resampled(), metrics_json(c)["interval"]
    for name in ("nmse", "nlpd"):
        low, high = np.quantile(getattr(draws, name).sum(axis=1), [0.025, 0.975])
        assert [low, high] == pytest.approx([expected_json[name]["low"], expected_json[name]["high"]], rel=1e-12)


def test_gaussian_density_is_exact_without_another() -> None:
    t = push_scores(comparison(exact=False))
    np.testing.assert_array_equal(t.exact_nlpd, t.nlpd)


def test_pooled_folds_equal_all_rows_at_once() -> None:
    c = comparison()
    fold = np.unique(c.push_id, return_inverse=True)[1] % 2
    parts, whole = pooled([push_scores(rows_of(c, fold == k)) for k in (1, 0)]), push_scores(c)
    for name in vars(whole):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))


def test_each_fold_keeps_its_own_training_mean() -> None:
    c = comparison(sizes=(3, 4))
    first, second = (rows_of(c, c.push_id == push) for push in ("push-9", "push-8"))
    moved = replace(second, training_mean=np.array([1e-3, 0.0, 0.1]))
    spread = np.sum(first.observed**2, axis=0) + np.sum((second.observed - moved.training_mean) ** 2, axis=0)
    expected = np.sum((c.observed - c.mean) ** 2, axis=0) / spread
    np.testing.assert_allclose(pooled([push_scores(first), push_scores(moved)]).totals().nmse[0], expected)


def test_push_of_several_seeds_is_one_push() -> None:
    one, other = comparison(seed=1), comparison(seed=2)
    both = pooled([push_scores(one), push_scores(other)])
    assert both.push_id.tolist() == sorted(set(one.push_id.tolist()))
    assert both.windows.sum() == 2 * sum(SIZES)


def test_push_drawn_twice_counts_twice() -> None:
    c = comparison()
    t = push_scores(c)
    weights = np.array([2.0, 0.0, 1.0, 3.0, 0.0, 0.0])
    rows = np.repeat(np.arange(len(c.push_id)), weights[np.unique(c.push_id, return_inverse=True)[1]].astype(int))
    expected, drawn = push_scores(rows_of(c, rows)).totals(), t.totals(weights[None])
    for name in ("nmse", "nlpd", "exact_nlpd", "coverage"):
        np.testing.assert_allclose(getattr(drawn, name), getattr(expected, name), rtol=1e-12)
