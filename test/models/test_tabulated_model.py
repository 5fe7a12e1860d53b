# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Tabulated models: an accurate table inside the domain, the model itself everywhere else; its compiled code."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from learnt_models import learnt
from synthetic import triangle

from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors.correlation import Correlation, covariances
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated import prediction_table as table_of
from push_predictor.models.tabulated.grid_posterior import on_grid
from push_predictor.models.tabulated.prediction_table import FASTEST, prediction_table, wide_box
from push_predictor.models.tabulated.spline import spline_values, table_moments
from push_predictor.models.tabulated.tabulated_model import (
    COMPUTED,
    COVARIANCE_TOLERANCE,
    MEAN_TOLERANCE,
    REFINEMENTS,
    TableAccuracy,
    TabulatedModel,
    outside_pushes,
    probed,
    relative_error,
    tabulate,
)
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

OUTLINES = {
    "square": shape_outline("rect1"),
    "hexagon": shape_outline("hex"),
    "ellipse": shape_outline("ellip3"),
    "circle": shape_outline("ellip1"),
    "triangle": triangle(),
}
SIZES = {"mean": 1e-3, "covariance": 1e-9, "process_covariance": 1e-9, "in_domain": 0.0}  # SI, of the smaller ones


def pushes(outline: Outline, n: int, low: Array, high: Array, seed: int = 0) -> PushTable:
    """Analytical outcomes with noise that grows with the angle; velocity, contact, angle between low and high (3,)."""
    rng = np.random.default_rng(seed)
    inputs = rng.uniform(low, high, (n, 3))
    duration = np.full(n, 0.2)
    exact = analytical_mechanics(outline, 0.00475).displacement(inputs, duration)
    noise = rng.standard_normal((n, 3)) * [1e-4, 1e-4, 3e-3] * (0.3 + np.abs(inputs[:, 2:]))
    return PushTable(inputs, duration, exact + noise, np.array([f"p{k}" for k in range(n)]))


def trained(outline: Outline, kind: str, low: Array, high: Array, n: int = 100, *, per_path: bool = True) -> PushModel:
    rig, options = Rig("made_up", outline, 0.00475, "plywood", 0.8), TrainingOptions(mean="zero", per_path=per_path)
    return train_model(pushes(outline, n, low, high), rig, kind, name=f"a {kind}", options=options)


WIDE = np.array([0.01, 0.0, -1.0]), np.array([0.05, 1.0, 1.0])


KINDS = ("gp", "vhgp", "coupled vhgp")


@cache
def trained_widely(shape: str, kind: str) -> PushModel:
    """Trained on pushes at all velocities, contacts and angles."""
    return trained(OUTLINES[shape], kind, *WIDE, n={"square": 100, "triangle": 110}.get(shape, 80))


@cache
def tabulated(shape: str, kind: str) -> TabulatedModel:
    """The table of a widely trained model; coupled: with a correlation that changes its sign."""
    model = trained_widely(shape, kind.split()[-1])
    return tabulate(coupled(model) if "coupled" in kind else independent(model))


def independent(model: PushModel) -> PushModel:
    return replace(model, predictor=replace(learnt(model), correlation=None))


def coupled(model: PushModel, bandwidth: float = 0.5) -> PushModel:
    return replace(model, predictor=replace(learnt(model), correlation=sign_change(model, bandwidth)))


def sign_change(model: PushModel, bandwidth: float) -> Correlation:
    """dx and dtheta correlate positively at angles above zero and negatively below; dy correlates with neither."""
    z = np.random.default_rng(7).standard_normal((len(model.training), 3))
    z[:, 2] = 0.2 * z[:, 2] + np.sign(model.training.inputs[:, 2]) * z[:, 0]
    return Correlation(learnt(model).regressions[0].inputs, z.astype(np.float32).astype(float), bandwidth, 2.0)


def inside(model: PushModel, n: int, seed: int = 5) -> Array:
    """Pushes spread over the domain of a model."""
    known = model.training.inputs
    drawn = np.random.default_rng(seed).uniform(known.min(axis=0), known.max(axis=0), (10 * n, 3))
    chosen = drawn[model.in_domain(drawn)][:n]
    assert len(chosen) == n
    return chosen


def of(model: PushModel | TabulatedModel, inputs: Array) -> Prediction:
    return model.predict_rows(inputs, np.full(len(inputs), 0.2))


def variances(covariance: Array) -> Array:
    return np.diagonal(covariance, axis1=1, axis2=2)


def assert_close(alone: Prediction, among: Prediction, row: int, precision: float) -> None:
    """The first of one are those in a row of the other."""
    for name, size in SIZES.items():
        one, other = getattr(alone, name)[0], getattr(among, name)[row]
        np.testing.assert_allclose(one, other, rtol=precision, atol=precision * size)


def assert_true_to_the_model(answers: TabulatedModel, inputs: Array | None = None) -> None:
    """Assert the model's predictions within the tolerances, at these pushes or at many inside its domain."""
    inputs = inside(answers.model, 300) if inputs is None else inputs
    table, exact = of(answers, inputs), of(answers.model, inputs)
    assert answers.tabulated, answers.how
    assert np.max(np.abs(table.mean - exact.mean) / np.sqrt(variances(exact.covariance))) < MEAN_TOLERANCE
    for ours, theirs in ((table.covariance, exact.covariance), (table.process_covariance, exact.process_covariance)):
        ratios = np.linalg.eigvals(np.linalg.solve(theirs, ours))
        assert np.max(np.abs(ratios - 1.0)) < COVARIANCE_TOLERANCE
    assert np.array_equal(table.in_domain, exact.in_domain)


# A coupled VHGP has all that a table can have. The triangle has no symmetry, so a box for each edge.
EACH = [
    *(("square", kind) for kind in KINDS),
    *(("ellipse", "coupled vhgp"), ("circle", "gp"), ("triangle", "coupled vhgp")),
]


def test_covariance_error_is_that_of_the_worst_combination_of_outputs() -> None:
    exact = np.array([[1.0, 0.0, 0.99], [0.0, 1.0, 0.0], [0.99, 0.0, 1.0]])
    found = exact.copy()
    found[0, 2] = found[2, 0] = 0.98  # one percent, but the variance of dx - dtheta has doubled
    turned = np.random.default_rng(0).standard_normal((3, 3)) * [1e-3, 1e-3, 1e-1]
    assert relative_error(found[None], exact[None]) == pytest.approx(1.0)
    both = (turned @ matrix @ turned.T for matrix in (found, exact))
    assert relative_error(*(matrix[None] for matrix in both)) == pytest.approx(1.0)
    assert not TableAccuracy(0.0, 0.006).accepted and TableAccuracy(0.0, 0.004).accepted


def test_a_table_refines_until_it_resolves_the_correlation(monkeypatch: pytest.MonkeyPatch) -> None:
    model = coupled(tabulated("circle", "gp").model, bandwidth=0.2)
    monkeypatch.setattr(table_of, "COUPLING_CELLS", 1.5)
    posteriors = [on_grid(regression) for regression in learnt(model).regressions]
    ends = wide_box(model, learnt(model))
    first = prediction_table(learnt(model), posteriors, ends, REFINEMENTS[0]).spline.knots
    answers = tabulate(model)
    assert answers.table is not None and answers.table.spline.knots > first
    assert_true_to_the_model(answers)


NARROW = {
    "one velocity": ([0.02, 0.0, -1.0], [0.02, 1.0, 1.0]),
    "one angle": ([0.01, 0.0, 0.1], [0.05, 1.0, 0.1]),
    "one contact": ([0.01, 0.1, -1.0], [0.05, 0.1, 1.0]),
    "one velocity and contact": ([0.02, 0.4, -1.0], [0.02, 0.4, 1.0]),
    "a part of an edge": ([0.01, 0.05, -1.0], [0.05, 0.2, 1.0]),
}


@pytest.mark.parametrize(
    ("shape", "narrow"),
    [*(("square", narrow) for narrow in NARROW), *(("circle", "one contact"), ("ellipse", "a part of an edge"))],
)
def test_constant_inputs_have_no_axis(shape: str, narrow: str) -> None:
    low, high = (np.array(limit) for limit in NARROW[narrow])
    model = trained(OUTLINES[shape], "gp", low, high, n=50)
    answers = tabulate(coupled(model))
    assert_true_to_the_model(answers, inside(model, 100))


@given(
    table=st.sampled_from(
        [
            ("square", "gp"),
            ("ellipse", "coupled vhgp"),
            ("circle", "gp"),
            ("triangle", "coupled vhgp"),
            ("hexagon", "coupled gp"),
        ]
    ),
    velocity=st.floats(0.005, 0.06),
    contact=st.floats(0.0, 1.0, exclude_max=True),
    angle=st.floats(-1.2, 1.2),
)
def test_single_push_gets_the_prediction_it_has_in_a_batch(
    table: tuple[str, str], velocity: float, contact: float, angle: float
) -> None:
    model, push = tabulated(*table), np.array([[velocity, contact, angle]])
    others = inside(model.model, 20)
    alone, among = of(model, push), of(model, np.concatenate([others[:10], push, others[10:]]))
    # Outside the domain the model itself predicts; its solver takes one row or many in a different order.
    precision = 1e-12 if alone.in_domain[0] else 1e-8
    assert_close(alone, among, 10, precision)


@pytest.mark.parametrize(("shape", "kind"), EACH)
def test_a_table_is_accurate_and_reaches_all_contacts_all_angles_and_twice_the_speed(shape: str, kind: str) -> None:
    answers = tabulated(shape, kind)
    outside = outside_pushes(answers.model, 200)
    assert np.ptp(outside, axis=0) == pytest.approx([0.1, 1.0, 3.1], rel=0.05)
    assert answers.exact_count(outside) == 0 and not of(answers, outside).in_domain.any()
    for inputs in (None, outside):
        assert_true_to_the_model(answers, inputs)


def test_a_table_is_compared_with_the_model_outside_the_domain_too() -> None:
    model = trained_widely("square", "gp")
    assert np.sum(~model.in_domain(probed(model, 20).inputs)) == 20


@pytest.mark.parametrize("shape", ["square", "circle"])
def test_faster_pushes_are_predicted_by_the_model_unless_it_is_per_path(shape: str) -> None:
    model = tabulate(coupled(trained(OUTLINES[shape], "gp", *WIDE, n=80, per_path=False)))
    fast = inside(model.model, 30)
    fast[:, 0] = 1.001 * FASTEST * model.model.training.inputs[:, 0].max()
    table, exact = of(model, fast), of(model.model, fast)
    assert not table.in_domain.any() and model.exact_count(fast) == 30
    known = of(model, inside(model.model, 5))
    mixed = of(model, np.concatenate([fast, inside(model.model, 5)]))
    for name in SIZES:
        assert np.array_equal(getattr(table, name), getattr(exact, name))
        assert np.array_equal(getattr(mixed, name)[:30], getattr(exact, name))
        assert np.array_equal(getattr(mixed, name)[30:], getattr(known, name))
    assert np.array_equal(mixed.in_domain, [False] * 30 + [True] * 5)


def test_the_table_is_of_the_domain_alone_where_a_wide_one_would_be_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    wide = tabulate(independent(trained(OUTLINES["square"], "gp", *WIDE, per_path=False)))
    assert wide.table is not None
    monkeypatch.setattr(table_of, "MOST_KNOTS", wide.table.spline.knots - 1)
    narrow, outside = tabulate(wide.model), outside_pushes(wide.model, 50)
    assert_true_to_the_model(narrow)
    assert narrow.exact_count(outside) == 50 and narrow.exact_count(inside(wide.model, 50)) == 0
    assert np.array_equal(of(narrow, outside).mean, of(wide.model, outside).mean)


def test_boundary_of_the_domain_is_inside() -> None:
    for model in (tabulated(shape, kind) for shape, kind in EACH):
        rim = np.array([[v, 0.3, a] for v in (0.0, 1.0) for a in (0.0, 1.0)])
        known = model.model.training.inputs
        rim[:, [0, 2]] = known.min(axis=0)[[0, 2]] + rim[:, [0, 2]] * np.ptp(known, axis=0)[[0, 2]]
        table, exact = of(model, rim), of(model.model, rim)
        assert np.array_equal(table.in_domain, exact.in_domain)
        assert table.mean == pytest.approx(exact.mean, abs=1e-5)


def test_analytical_model_has_no_table() -> None:
    model = trained(OUTLINES["square"], "analytical", *WIDE)
    answers, inputs = tabulate(model), inside(model, 5)
    assert not answers.tabulated and answers.error is None and answers.how == COMPUTED
    for count in (1, 5):
        np.testing.assert_allclose(of(answers, inputs[:count]).mean, of(model, inputs[:count]).mean, rtol=0.0)


def test_too_large_table_is_not_built(monkeypatch: pytest.MonkeyPatch) -> None:
    model = tabulated("square", "gp").model  # cached: not within the patch
    for limit in ("MOST_KNOTS", "MOST_NODES"):
        with monkeypatch.context() as patch:
            patch.setattr(table_of, limit, 100)
            answers = tabulate(model)
        assert not answers.tabulated
        assert "at most 100" in answers.how


def test_inaccurate_table_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    model = tabulated("square", "vhgp").model
    for name in ("SIGNAL", "NOISE"):
        monkeypatch.setattr(table_of, name, table_of.Density(nodes=0.3, cells=0.3))
    for name in ("FEWEST_NODES", "FEWEST_CELLS"):
        monkeypatch.setattr(table_of, name, 4)
    answers, inputs = tabulate(model), inside(model, 5)
    assert not answers.tabulated
    assert "too far off" in answers.how
    assert np.array_equal(of(answers, inputs).covariance, of(model, inputs).covariance)


# --- the compiled code ---


def test_more_functions_or_axes_than_the_compiled_code_has_places_for_are_refused() -> None:
    one = np.ones(1)
    for axes, functions in ((4, 1), (1, 17), (0, 1)):
        with pytest.raises(ValueError, match="1 to 3 and at most 16 are accepted"):
            spline_values(
                np.zeros((1, axes)), np.zeros(1, np.intp), one, one, np.ones(1, np.intp),
                np.zeros((4, functions), np.float32), np.zeros((1, functions)),
            )  # fmt: skip


@pytest.mark.parametrize("coupled", [False, True])
def test_moments_are_the_covariances_of_variances_and_correlation(coupled: bool) -> None:
    """The partial correlations in the table are inverse hyperbolic tangents; see partial_correlation."""
    draw, n = np.random.default_rng(1), 40
    values = draw.standard_normal((n, 12 if coupled else 9))
    least = np.array([0.1, 0.2, 0.05])
    correlation = None
    if coupled:
        first, second, partial = np.tanh(values[:, 9:]).T
        third = first * second + partial * np.sqrt((1.0 - first**2) * (1.0 - second**2))
        correlation = np.tile(np.eye(3), (n, 1, 1))
        for (i, j), r in zip(((0, 1), (0, 2), (1, 2)), (first, second, third), strict=True):
            correlation[:, i, j] = correlation[:, j, i] = r
    expected = covariances(np.maximum(values[:, 3:6], least), np.exp(values[:, 6:9]), correlation)
    found = np.full((n, 3, 3), np.nan), np.full((n, 3, 3), np.nan)
    table_moments(values, least, *found)
    for ours, theirs in zip(found, expected, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-13)
    assert np.any(values[:, 3:6] < least) and np.all(np.linalg.eigvalsh(found[0]) > 0.0)
