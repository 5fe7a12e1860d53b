# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of the validation report: folding, ellipses, calibration and drift."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gaussian_comparisons import gaussian_comparison
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import f, kstest, multivariate_t

from push_predictor.evaluation.metrics import standardised
from push_predictor.evaluation.report.figures.calibration import (
    LEVELS,
    coverage_chart,
    coverage_curve,
    expected_counts,
)
from push_predictor.evaluation.report.figures.ellipses import ellipse, inside, magnification, spread_rows, start_pose
from push_predictor.evaluation.report.figures.residuals import trend
from push_predictor.evaluation.report.maps import arc_length, sector_length
from push_predictor.evaluation.validation import pit
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.shapes import SHAPES, shape_outline
from push_predictor.models.predictors.tails import STEPS, Tails
from push_predictor.reporting.chart import Band, Line

# --- folding --------------------------------------------------------------------------------------------------------


@given(contact=st.floats(0.0, 0.2499), quarter=st.integers(0, 3))
def test_arc_length_is_equal_on_all_sides_of_a_square(contact: float, quarter: int) -> None:
    outline = shape_outline("rect1")
    along = arc_length(outline, np.array([contact, contact + 0.25 * quarter]))
    assert along[0] == pytest.approx(contact * 0.36, abs=1e-12)
    assert along[1] == pytest.approx(along[0], abs=1e-12)


@pytest.mark.parametrize(("shape", "edges", "length"), [("rect1", 4, 0.09), ("hex", 6, 0.0605)])
def test_end_of_an_edge_has_the_arc_length_of_the_edge(shape: str, edges: int, length: float) -> None:
    outline = shape_outline(shape)
    ends = outline.contact_on_edge(np.arange(edges), np.ones(edges))
    assert arc_length(outline, ends) == pytest.approx(np.full(edges, length))
    starts = outline.contact_on_edge(np.arange(edges), np.zeros(edges))
    assert arc_length(outline, starts) == pytest.approx(np.zeros(edges), abs=1e-12)


def test_ellipse_has_two_equal_parts_and_circle_is_not_folded() -> None:
    ellipse_outline, circle = shape_outline("ellip2"), shape_outline("ellip1")
    contact = np.array([0.1, 0.6])
    assert np.ptp(arc_length(ellipse_outline, contact)) == pytest.approx(0.0, abs=1e-12)
    assert sector_length(ellipse_outline) == pytest.approx(ellipse_outline.perimeter / 2.0)
    assert arc_length(circle, contact) == pytest.approx(contact * circle.perimeter)


# --- ellipses and examples ------------------------------------------------------------------------------------------


def test_ellipse_contains_its_share_of_outcomes() -> None:
    c = gaussian_comparison(1.0)
    hits = [inside(c.mean[k], c.covariance[k], c.observed[[k]], None)[0] for k in range(len(c.mean))]
    assert np.mean(hits) == pytest.approx(0.95, abs=0.02)
    border = ellipse(c.covariance[0, :2, :2], None)
    squared = np.sum(border * np.linalg.solve(c.covariance[0, :2, :2], border.T).T, axis=1)
    np.testing.assert_allclose(squared, -2.0 * np.log(0.05), rtol=1e-9)


def test_ellipse_is_that_of_the_tails() -> None:
    c, tails = gaussian_comparison(1.0), Tails(np.ones(3), np.full(3, 4.0), 0.8, 3.0, 20, np.zeros((STEPS, 3)))
    border = ellipse(c.covariance[0, :2, :2], tails, 0.9)
    squared = np.sum(border * np.linalg.solve(c.covariance[0, :2, :2], border.T).T, axis=1)
    np.testing.assert_allclose(squared, 2.0 * 0.8**2 * f.ppf(0.9, 2, 3.0), rtol=1e-9)
    root = np.linalg.cholesky(c.covariance[0])
    draws = 0.8 * multivariate_t(shape=np.eye(3), df=3.0, seed=0).rvs(20_000) @ root.T
    assert np.mean(inside(np.zeros(3), c.covariance[0], draws, tails, 0.9)) == pytest.approx(0.9, abs=0.01)


@given(seed=st.integers(0, 10_000), count=st.integers(1, 9))
@settings(max_examples=30, deadline=None)
def test_examples_come_from_different_pushes(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    push_id = rng.integers(0, 6, 40).astype(np.str_)
    rows = spread_rows(rng.normal(size=(40, 2)), push_id, count)
    assert len(rows) == min(count, len(set(push_id.tolist())))
    assert len(set(push_id[rows].tolist())) == len(rows)


@pytest.mark.parametrize("shape", SHAPES)
@given(contact=st.floats(0.0, 0.999), angle=st.floats(-1.5, 1.5))
@settings(max_examples=25, deadline=None)
def test_slider_touches_the_origin_and_is_pushed_to_the_right(shape: str, contact: float, angle: float) -> None:
    outline = shape_outline(shape)
    pose = start_pose(outline, np.array([0.02, contact, angle]))
    touch = rotate(outline.point(np.array([contact]))[0], pose[2]) + pose[:2]
    np.testing.assert_allclose(touch, 0.0, atol=1e-12)
    normal = rotate(outline.inward_normal(np.array([contact]))[0], pose[2])
    assert -np.arctan2(normal[1], normal[0]) == pytest.approx(angle, abs=1e-9)


def test_small_motions_are_enlarged_and_large_ones_are_not() -> None:
    outline = shape_outline("rect1")
    assert magnification(outline, np.array([[0.0004, 0.0, 0.0]])) == 20.0
    assert magnification(outline, np.array([[0.05, 0.0, 0.0]])) == 1.0


# --- calibration and drift ------------------------------------------------------------------------------------------


def test_coverage_of_a_calibrated_prediction_is_on_the_diagonal_of_an_overconfident_one_below() -> None:
    share, low, high = coverage_curve(gaussian_comparison(1.0))
    assert np.abs(share - LEVELS[:, None]).max() < 0.04
    assert np.all(low <= share) and np.all(share <= high)
    overconfident = coverage_curve(gaussian_comparison(0.5))[0]
    assert np.all(overconfident[5:-5] < LEVELS[5:-5, None] - 0.03)
    for column in pit(gaussian_comparison(1.0)).T:
        assert kstest(column, "uniform").pvalue > 1e-3
    assert kstest(pit(gaussian_comparison(0.5))[:, 0], "uniform").pvalue < 1e-6


def test_band_of_the_pit_counts_the_windows_of_a_push_together() -> None:
    """Alone, windows scatter as binomial counts do; in pushes of 5 equal windows, root 5 times as much."""
    rng = np.random.default_rng(4)
    alone = expected_counts(rng.random(2000), np.arange(2000).astype(np.str_))
    assert np.mean(alone) == pytest.approx(200.0)
    assert np.diff(alone)[0] == pytest.approx(2.0 * 1.96 * np.sqrt(2000 * 0.1 * 0.9), rel=0.01)
    together = expected_counts(np.repeat(rng.random(400), 5), np.repeat(np.arange(400), 5).astype(np.str_))
    assert np.diff(together)[0] == pytest.approx(np.sqrt(5.0) * np.diff(alone)[0], rel=0.01)
    one_push = expected_counts(np.append(rng.random(39), 1.0), np.zeros(40, dtype=np.str_))
    assert one_push[0] >= 0.0


def test_joint_region_is_that_of_the_tails() -> None:
    c = gaussian_comparison(1.0)
    tails = Tails(np.ones(3), np.full(3, 4.0), 0.8, 3.0, 20, np.zeros((STEPS, 3)))
    away = np.linalg.norm(standardised(c.mean, c.covariance, c.observed), axis=1)
    np.testing.assert_array_equal(replace(c, tails=tails).joint_covered([0.9])[:, 0], away <= tails.joint_radius(0.9))
    assert c.joint_covered([0.9]).mean() == pytest.approx(0.9, abs=0.02)
    assert replace(c, tails=tails).joint_covered([0.9]).mean() > 0.91


def test_trend_detects_a_drift_and_none_without_one() -> None:
    rng = np.random.default_rng(8)
    place, push_id = np.repeat(np.arange(60.0), 5), np.repeat(np.arange(60).astype(np.str_), 5)
    still = np.repeat(rng.normal(size=60), 5) + 0.3 * rng.normal(size=300)
    found = trend(place, still, push_id)
    assert found is not None and found.low < 0.0 < found.high
    drifting = trend(place, still + 3.0 * place / 59.0, push_id)
    assert drifting is not None and drifting.low > 0.0
    assert drifting.value == pytest.approx(found.value + 3.0, abs=1e-9)
    assert trend(place[:5], still[:5], push_id[:5]) is None


def test_coverage_chart_shows_each_output_and_its_band() -> None:
    chart = coverage_chart(gaussian_comparison(0.5, pushes=40))
    bands = [mark for mark in chart.marks if isinstance(mark, Band)]
    lines = [mark for mark in chart.marks if isinstance(mark, Line)]
    assert [line.name for line in lines] == ["as promised", "Δx", "Δy", "Δθ"] and len(bands) == 3
    for band, line in zip(bands, lines[1:], strict=True):
        assert np.all((band.low <= line.y) & (line.y <= band.high)) and line.kind == band.kind
        assert np.all(line.y[5:-5] < line.x[5:-5])  # too narrow: below the diagonal, in percent
        assert line.x[-1] == pytest.approx(98.0) and line.y[-1] > 50.0
