# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scores by push: pooling over folds, resampling of whole pushes, agreement with the scores by row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from push_predictor.evaluation.metrics import COVERAGE_LEVELS
from push_predictor.evaluation.push_scores import pooled, push_scores
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.recordings.table import OUTPUTS

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


def test_models_of_the_same_pushes_share_their_bootstrap_samples() -> None:
    t = push_scores(comparison())
    np.testing.assert_array_equal(t.resampled().nmse, t.totals(push_bootstrap(t.push_id)).nmse)
    np.testing.assert_array_equal(t.resampled(seed=5).nlpd, t.totals(push_bootstrap(t.push_id, 5)).nlpd)
