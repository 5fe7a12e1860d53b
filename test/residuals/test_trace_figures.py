# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The numbers in the pictures of a trace: bins, curves and bands of an effect, its size, errors of held-out pushes."""

from __future__ import annotations

from dataclasses import replace

import made_up_traces as made_up
import numpy as np
import pytest
from made_up_traces import JUMP, made_up_trace, planted, slippery, trace_of

from push_predictor.evaluation.push_scores import push_means
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.reporting.chart import Bars, Dots
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.driver_basis import (
    analysis_rows,
    basis_charts,
    per_push,
    responses,
    strength_of,
)
from push_predictor.residuals.reporting.figures.gallery import effect_figures
from push_predictor.residuals.reporting.figures.pushes import axis_of, bins_along, error_charts, means_along
from push_predictor.residuals.reporting.phrases import shift_size


@pytest.fixture
def drift() -> Trace:
    """Contact friction that drifts; the push count correlates with the time."""
    return trace_of("mechanism_only")


def test_key_chart_shows_the_step_of_the_effect() -> None:
    trace = trace_of("effect")
    (chart,) = basis_charts(trace, strength_of(trace.terms[0]), analysis_rows(trace))
    dots = next(mark for mark in chart.marks if isinstance(mark, Dots))
    before, after = dots.x < JUMP.place, dots.x > JUMP.place
    assert abs(np.nanmedian(dots.y[before])) < 0.03 and np.nanmedian(dots.y[after]) == pytest.approx(0.15, abs=0.03)


def test_effect_is_drawn_once_with_all_its_parameters() -> None:
    """The key picture shows the first effect's only parameter, and the noise along the covariate if it is unknown."""
    along = DriverBasis("linear", ("elapsed_time",), (500.0,), (300.0,))
    grain = made_up_trace(slippery(0.06), planted("anisotropic_friction", "elapsed_time", along, 0.1, 0.05))
    (figure,) = effect_figures(grain)
    assert figure.count('<svg class="chart') == 2
    assert "irection-dependent friction of the table against elapsed time (linear)" in figure
    assert effect_figures(trace_of("effect")) == [] == effect_figures(trace_of("driver_only"))


def test_held_out_errors_are_shown_for_each_push_before_and_after() -> None:
    trace = trace_of("effect")
    shown = trace.comparisons
    position, heading = error_charts(trace.held_out.table, "elapsed_time", [shown[0], shown[-1]])
    for chart in (position, heading):
        before, after = (mark for mark in chart.marks if isinstance(mark, Dots))
        assert len(before.x) == len(after.x) == len(trace.held_out.table.pushes)
        late = before.x > JUMP.place
        assert np.mean(before.y[late]) > 1.3 * np.mean(after.y[late])
    error = 1e3 * (shown[0].observed - shown[0].mean)[:, :2]
    square = [np.mean(np.sum(error[shown[0].push_id == push] ** 2, axis=1)) for push in np.unique(shown[0].push_id)]
    dots = next(mark for mark in position.marks if isinstance(mark, Dots))
    np.testing.assert_allclose(dots.y, np.sqrt(square))


def test_levels_of_a_covariate_are_bins_of_their_own() -> None:
    rng = np.random.default_rng(0)
    speed = np.repeat([0.01, 0.02, 0.05], [30, 90, 30]) + 1e-4 * rng.standard_normal(150)
    bins = bins_along(speed, 10)
    assert [len(np.unique(bins[part])) for part in (slice(0, 30), slice(30, 120), slice(120, 150))] == [1, 1, 1]
    assert len(np.unique(bins)) == 3 and len(np.unique(bins_along(rng.random(500), 10))) == 10


def test_bins_have_the_mean_and_an_interval_around_it() -> None:
    table = made_up.pushes(80, 4)
    bins = means_along(axis_of(table, "elapsed_time"), table.push_id, table.covariates["elapsed_time"])
    np.testing.assert_allclose(bins.place, bins.value)
    assert len(bins.place) == 10
    assert np.all((bins.low <= bins.value) & (bins.value <= bins.high))
    bars = bins.bars("before", "s", "pushes, in bins")
    assert bars.y is bins.value and bars.low is bins.low and bars.high is bins.high and " s (95 % CI " in bars.titles[0]


def test_covariate_that_is_not_recorded_gives_way_to_the_time() -> None:
    table = made_up.pushes(10, 4)
    assert axis_of(table, "model_inputs").label == "Elapsed time (s)"
    assert axis_of(replace(table, covariates={}), "model_inputs").label == "Push count"
    assert axis_of(table, "slider_heading").x.max() > 10.0  # degrees


def test_bins_follow_the_data_rather_than_a_wrong_fit() -> None:
    """A step, fitted by a line: the bins stay on the step."""
    trace = trace_of("effect")
    line = made_up.traced(trace.model, trace.analysis, trace.held_out.table, (slippery(0.1),))
    (chart,) = basis_charts(line, strength_of(line.terms[0]), analysis_rows(line))
    bins = next(mark for mark in chart.marks if isinstance(mark, Bars))
    before, after = bins.y[bins.x < 600.0], bins.y[bins.x > 650.0]
    assert after.mean() - before.mean() == pytest.approx(0.15, abs=0.04)
    assert abs(before[-1] - before[0]) < 0.4 * 0.15


def test_band_follows_the_covariance_of_the_coefficients(drift: Trace) -> None:
    strength = strength_of(drift.terms[0])
    _, half = strength.curve({"elapsed_time": np.array([500.0, 800.0])}, 2)
    np.testing.assert_allclose(half[:, 0], [0.0, 1.96 * np.sqrt(drift.terms[0].covariance[0, 0])], rtol=1e-12)


def test_single_pushes_have_the_curve_as_median(drift: Trace) -> None:
    strength, rows = strength_of(drift.terms[0]), analysis_rows(drift)
    value = per_push(strength, rows, responses(drift, strength, rows))
    place = push_means(rows.table.push_id, rows.table.covariates["elapsed_time"])[1]
    assert len(value) == len(drift.analysis.pushes)
    off = value[:, 0] - strength.curve({"elapsed_time": place}, len(place))[0][:, 0]
    assert abs(np.nanmedian(off)) < 0.02


def test_shift_is_that_of_the_windows(drift: Trace) -> None:
    twice = replace(drift.terms[0], coefficients=2.0 * drift.terms[0].coefficients)
    (metres, radians), larger = shift_size(drift, drift.terms[0]), shift_size(drift, twice)
    assert larger == pytest.approx((2.0 * metres, 2.0 * radians), rel=0.2)
    observed = drift.held_out.before.observed
    assert 0.0 < metres < 0.5 * np.hypot(*np.sqrt(np.mean(observed[:, :2] ** 2, axis=0)))
