# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Effects from a table: close to the exact ones inside, the exact ones outside."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from coarse import coarse_effects
from drifting_models import pushes
from push_predictor.models.tabulated.effect_tables import accuracy, build
from push_predictor.models.tabulated.effect_tables.axes import change_axes
from push_predictor.models.tabulated.effect_tables.table import EffectTable
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import BASES, DriverBasis
from push_predictor.models.effects.effect import Effect, mechanism_named
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import ExtendedPredictor, MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.store import table_cache
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.store.table_cache import as_served
from push_predictor.models.tabulated.table_accuracy import TableAccuracy, relative_error
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate, with_effect_table
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

ALWAYS = DriverBasis("constant")
DRIFT = DriverBasis("linear", ("elapsed_time",), (500.0,), (300.0,))
LATER = DriverBasis("step", ("elapsed_time",), place=500.0)
AROUND = DriverBasis("periodic", ("slider_heading",))
MAP = DriverBasis("map", ("topic:/warmth", "elapsed_time"), (0.0, 500.0), (1.0, 300.0))
OUTCOME = np.array([0.02, 0.02, 0.5])


@pytest.fixture(scope="module", autouse=True)
def coarse_integration() -> Iterator[None]:
    """Errors of a few percent of the noise, in the tables as in the models that they are compared with."""
    with coarse_effects():
        yield


@pytest.fixture(autouse=True)
def small_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sixth of the usual work; tables that are a little too coarse are used nevertheless."""
    monkeypatch.setattr(build, "ATTEMPTS", ((35_000, 1.0),))
    monkeypatch.setattr(build, "COARSEST", 0.0)
    monkeypatch.setattr(accuracy, "MEAN_TOLERANCE", 0.5)
    monkeypatch.setattr(accuracy, "COVARIANCE_TOLERANCE", 0.3)


def effect(mechanism: str, basis: DriverBasis, size: float = 1.0, exact: bool = True) -> Effect:
    """Of alternating signs, known to 10 %; size: in units of the parameters' usual spreads."""
    quantities = mechanism_named(mechanism).quantities
    width = basis.values({name: np.zeros(1) for name in basis.drivers}, 1).shape[1]
    spreads = np.repeat([BY_NAME[name].spread for name in quantities], width)
    signs = np.where(np.arange(len(spreads)) % 2, -1.0, 1.0)
    covariance = np.diag((0.1 * spreads) ** 2)
    return Effect(mechanism, "any", basis, size * signs * spreads, covariance, OUTCOME, exact=exact)


GENERIC = Effect(None, "elapsed_time", DRIFT, np.full(18, 0.05), 1e-4 * np.eye(18), OUTCOME)
CASES = {
    "constant": (effect("contact_friction", ALWAYS),),
    "linear": (effect("contact_friction", DRIFT),),
    "step": (effect("contact_friction", LATER),),
    "step and linear": (effect("centre_of_friction", LATER), effect("contact_friction", DRIFT)),
    "map": (effect("contact_friction", MAP, 0.2),),
    "periodic": (effect("contact_friction", AROUND),),
    "in the world": (effect("anisotropic_friction", ALWAYS),),
    "linear in its coefficients": (effect("contact_friction", DRIFT, 0.5, exact=False), GENERIC),
}


@cache
def base(kind: str) -> PushModel:
    """About nothing, about mechanics with a shifted centre, these mechanics alone, or the analytical model."""
    rows = pushes(15 if kind == "about mechanics" else 40)
    mechanics = PushMechanics(square_rig().outline, square_rig().pusher_radius)
    fitted = FittedMechanics(mechanics, {"contact_friction": 0.25, "centre_x": 0.003})
    if kind in ("analytical", "fitted"):
        model = train_model(rows, square_rig(), "analytical", name=kind)
        covariance = np.diag(np.array([1e-4, 1e-4, 3e-3]) ** 2)
        return model if kind == "analytical" else replace(model, predictor=MechanicsPredictor(fitted, covariance))
    options = TrainingOptions(about=fitted) if kind == "about mechanics" else TrainingOptions(mean="zero")
    return train_model(rows, square_rig(), "gp", name=kind, options=options)


def extended(kind: str, *effects: Effect) -> PushModel:
    plain = base(kind)
    predictor = ExtendedPredictor(plain.predictor.base, plain.predictor.physics, effects, np.array([1.0, 1.1, 0.9]))
    return replace(plain, predictor=predictor)


@cache
def both(kind: str, case: str) -> tuple[TabulatedModel, TabulatedModel]:
    """Without and with a table of effects."""
    computed = tabulate(extended(kind, *CASES[case]))
    return computed, with_effect_table(computed)


def predicted(model: TabulatedModel | PushModel, table: PushTable) -> Prediction:
    return model.predict_rows(table.inputs, table.duration, table.covariates)


def single(model: TabulatedModel, table: PushTable, row: int = 0) -> Prediction:
    return predicted(model, table.take(np.array([row])))


def inside(n: int = 60) -> PushTable:
    """New pushes between those of the training."""
    rows = pushes(n, 5)
    keep = (np.abs(rows.inputs[:, 2]) < 0.85) & (np.abs(rows.covariates["topic:/warmth"]) < 1.5)
    return rows.take(np.flatnonzero(keep))


def assert_equal(one: Prediction, other: Prediction, **precision: float) -> None:
    for name in ("mean", "covariance", "process_covariance", "in_domain"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), **(precision or {"rtol": 1e-12}))


@pytest.mark.parametrize(
    ("kind", "case"),
    [
        *[("about nothing", case) for case in ("linear", "step and linear")],
        pytest.param("about mechanics", "linear", marks=pytest.mark.long),
        *[("analytical", case) for case in ("linear", "step and linear")],
        pytest.param("fitted", "linear", marks=pytest.mark.long),
    ],
)
def test_table_is_close_to_the_exact_effects(kind: str, case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if kind == "fitted":  # its noise is small
        monkeypatch.setattr(build, "ATTEMPTS", ((50_000, 1.0),))
    assert_close(kind, case)


@pytest.mark.parametrize("case", ["constant", "map", "periodic", "in the world", "linear in its coefficients"])
def test_table_is_close_for_every_kind_of_effect(case: str) -> None:
    assert_close("about nothing", case)


def assert_close(kind: str, case: str) -> None:
    computed, table = both(kind, case)
    assert table.effects is not None, table.how
    rows = inside()
    found, exact = predicted(table, rows), predicted(computed, rows)
    away = np.abs(found.mean - exact.mean).max(axis=0)
    assert away.max() > 0.0  # the table was used
    apart = np.abs(found.mean - exact.mean) / exact.std
    shift = np.abs(exact.mean - predicted(base(kind), rows).mean) / exact.std
    assert np.median(apart) < 0.02 and np.quantile(apart, 0.95) < 0.2, (np.median(apart), np.quantile(apart, 0.95))
    assert np.sqrt(np.mean(apart**2)) < 0.15 * np.sqrt(np.mean(shift**2))
    assert np.quantile(relative_error(found.covariance, exact.covariance), 0.95) < 0.1
    np.testing.assert_allclose(found.process_covariance, exact.process_covariance, rtol=2e-3, atol=1e-12)
    assert np.array_equal(found.in_domain, exact.in_domain)


@pytest.mark.parametrize("case", [case for case in CASES if case != "step"])
def test_a_push_gets_the_same_prediction_alone_as_among_others(case: str) -> None:
    _, table = both("about nothing", case)
    rows = inside(20)
    together = predicted(table, rows)
    for k in range(0, len(rows), 4):
        alone = single(table, rows, k)
        np.testing.assert_allclose(alone.mean[0], together.mean[k], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(alone.covariance[0], together.covariance[k], rtol=1e-9)
        assert alone.in_domain[0] == together.in_domain[k]


def with_inputs(rows: PushTable, column: int, value: float) -> PushTable:
    inputs = rows.inputs.copy()
    inputs[:, column] = value
    return replace(rows, inputs=inputs)


def with_covariate(rows: PushTable, name: str, values: Array) -> PushTable:
    return replace(rows, covariates={**rows.covariates, name: values})


def at(rows: PushTable, time: float) -> PushTable:
    return with_covariate(rows, "elapsed_time", np.full(len(rows), time))


OUTSIDE = {
    "angle": lambda rows: with_inputs(rows, 2, 1.1),
    "angle to the right": lambda rows: with_inputs(rows, 2, -1.1),
    "speed": lambda rows: with_inputs(rows, 0, 0.03),
    "covariate": lambda rows: at(rows, 2010.0),
    "covariate before": lambda rows: at(rows, -10.0),
}


@pytest.mark.parametrize("what", OUTSIDE)
def test_outside_the_table_effects_are_computed(what: str) -> None:
    computed, table = both("analytical", "linear")
    rows = OUTSIDE[what](inside(6))
    assert_equal(predicted(table, rows), predicted(computed, rows))
    assert_equal(single(table, rows), single(computed, rows))
    mixed = rows.take(np.arange(4))
    known = inside(6).take(np.arange(4, 8))
    merged = PushTable(
        np.concatenate([mixed.inputs, known.inputs]),
        np.concatenate([mixed.duration, known.duration]),
        np.concatenate([mixed.outcomes, known.outcomes]),
        np.concatenate([mixed.push_id, known.push_id]),
        {name: np.concatenate([column, known.covariates[name]]) for name, column in mixed.covariates.items()},
    )
    found = predicted(table, merged)
    np.testing.assert_allclose(found.mean[:4], predicted(computed, mixed).mean, rtol=1e-9)
    np.testing.assert_allclose(found.mean[4:], predicted(table, known).mean, rtol=1e-9)


def test_slower_and_longer_is_the_same_where_the_mechanics_do_not_depend_on_speed() -> None:
    _, table = both("analytical", "linear")
    rows = inside(10)
    slow = replace(with_inputs(rows, 0, 0.01), duration=2.0 * rows.duration)
    np.testing.assert_allclose(predicted(table, slow).mean, predicted(table, rows).mean, rtol=1e-9)
    np.testing.assert_allclose(single(table, slow).mean, single(table, rows).mean, rtol=1e-9)
    delayed = tabulate(extended("analytical", effect("contact_friction", DRIFT)))
    late = FittedMechanics(delayed.model.predictor.mechanics.mechanics, {"clock_delay": 0.02})
    predictor = replace(delayed.model.predictor, of_effects=late)
    delayed = replace(delayed, model=replace(delayed.model, predictor=predictor))
    tabled = with_effect_table(delayed)
    assert tabled.effects is not None and not tabled.effects.any_duration, tabled.how
    assert_equal(predicted(tabled, slow), predicted(delayed, slow))
    assert_equal(single(tabled, slow), single(delayed, slow))
    assert np.abs(predicted(tabled, rows).mean - predicted(delayed, rows).mean).max() > 0.0


def test_headings_of_slider_and_push_that_disagree_are_computed() -> None:
    computed, table = both("about nothing", "in the world")
    rows = inside(6)
    normal = square_rig().outline.inward_normal(rows.inputs[:, 1])
    heading = rows.covariates["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + rows.inputs[:, 2]
    agree, differ = (with_covariate(rows, "push_heading", heading + by) for by in (2.0 * np.pi, 0.5))
    assert_equal(predicted(table, agree), predicted(table, rows), rtol=1e-9)
    assert_equal(single(table, agree), single(table, rows), rtol=1e-9)
    assert_equal(predicted(table, differ), predicted(computed, differ))
    assert_equal(single(table, differ), single(computed, differ))


def test_changes_that_did_not_occur_together_are_computed() -> None:
    """In training both effects follow each other: their changes lie on a line. The table has no push off this line."""
    warm, damp = (DriverBasis("linear", (f"topic:/{name}",), (0.0,), (1.0,)) for name in ("warmth", "damp"))
    model = extended("analytical", effect("contact_friction", damp, 0.5), effect("pressure_spread", warm, 0.5))
    rows = model.training
    computed = tabulate(replace(model, training=with_covariate(rows, "topic:/damp", rows.covariates["topic:/warmth"])))
    table = with_effect_table(computed)
    assert table.effects is not None and len(table.effects.change.directions) == 1, table.how
    known = inside(6)
    apart = with_covariate(known, "topic:/damp", 0.5 + known.covariates["topic:/warmth"])
    assert_equal(predicted(table, apart), predicted(computed, apart))
    for row in range(len(apart)):
        assert_equal(single(table, apart, row), single(computed, apart, row))


@pytest.mark.filterwarnings("ignore:invalid value")
def test_an_infinite_heading_has_no_finite_prediction() -> None:
    for model in both("about nothing", "periodic"):
        rows = inside(2)
        found = single(model, with_covariate(rows, "slider_heading", np.full(len(rows), np.inf)))
        assert np.isnan(found.covariance).any() and not found.in_domain[0]


def test_an_effect_of_size_zero_leaves_the_base_its_mean() -> None:
    table = with_effect_table(tabulate(extended("about nothing", effect("contact_friction", LATER, 0.0))))
    assert table.effects is not None
    rows = inside()
    found, plain = predicted(table, rows), predicted(tabulate(base("about nothing")), rows)
    np.testing.assert_allclose(found.mean, plain.mean, atol=1e-12)
    later = rows.covariates["elapsed_time"] >= 500.0
    widened = found.covariance[:, 2, 2] - plain.covariance[:, 2, 2] * 0.81
    assert np.abs(widened[~later]).max() < 1e-12 and np.median(widened[later]) > 1e-7


@pytest.mark.parametrize("kind", ["about nothing", "analytical"])
@pytest.mark.parametrize("case", ["linear", "linear in its coefficients"])
def test_later_pushes_are_in_the_table_but_not_in_the_domain(kind: str, case: str) -> None:
    computed, table = both(kind, case)
    for time in (1010.0, 1990.0):
        rows = at(inside(), time)
        found, exact = predicted(table, rows), predicted(computed, rows)
        apart = np.abs(found.mean - exact.mean) / exact.std
        assert 0.0 < np.quantile(apart, 0.95) < 0.2 and not found.in_domain.any()
        assert np.quantile(relative_error(found.covariance, exact.covariance), 0.95) < 0.1
        for row in range(0, len(rows), 10):
            np.testing.assert_allclose(single(table, rows, row).mean[0], found.mean[row], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("time", [-10.0, 2010.0])
def test_linear_effects_are_computed_where_their_table_would_be_stretched(time: float) -> None:
    """The error of a derivative grows with the covariate that it is multiplied by."""
    computed, table = both("analytical", "linear in its coefficients")
    rows = at(inside(6), time)
    assert_equal(predicted(table, rows), predicted(computed, rows))
    assert_equal(single(table, rows), single(computed, rows))


def test_each_linear_effect_has_a_range_of_its_own() -> None:
    warm = effect("contact_friction", DriverBasis("linear", ("topic:/warmth",), (0.0,), (1.0,)), 0.5, exact=False)
    computed = tabulate(extended("analytical", GENERIC, warm))
    table, rows = with_effect_table(computed), inside(6)
    assert table.effects is not None
    hot = with_covariate(rows, "topic:/warmth", np.full(len(rows), 4.0))
    assert_equal(predicted(table, hot), predicted(computed, hot))
    assert_equal(single(table, hot), single(computed, hot))
    assert np.abs(single(table, rows).mean - single(computed, rows).mean).max() > 0.0


def refused_later(monkeypatch: pytest.MonkeyPatch, off: tuple[float, float] = (99.0, 99.0)) -> None:
    """Tables are taken for inaccurate at later pushes."""
    errors = accuracy._errors

    def later_are_off(table: EffectTable, sample: accuracy.Sample, quantile: float) -> tuple[float, float]:
        late = sample.push.covariates["elapsed_time"].max() > 1000.0
        return off if late else errors(table, sample, quantile)

    monkeypatch.setattr(accuracy, "_errors", later_are_off)


@pytest.mark.parametrize("case", ["linear", "linear in its coefficients"])
@pytest.mark.parametrize("off", [(99.0, 0.0), (0.0, 99.0)])
def test_a_table_that_is_inaccurate_at_later_pushes_ends_with_the_training(
    case: str, off: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    refused_later(monkeypatch, off)
    computed = tabulate(extended("analytical", *CASES[case]))
    table, rows = with_effect_table(computed), inside()
    assert table.effects is not None and not table.effects.later and "later" not in table.how
    assert_equal(predicted(table, at(rows, 1010.0)), predicted(computed, at(rows, 1010.0)))
    assert np.abs(predicted(table, rows).mean - predicted(computed, rows).mean).max() > 0.0


def test_a_finer_table_with_later_pushes_is_preferred_to_a_coarse_one_without(monkeypatch: pytest.MonkeyPatch) -> None:
    def by_size(table: EffectTable, *_: object) -> TableAccuracy:
        return TableAccuracy(99.0 if table.later and table.spline.knots < 10_000 else 0.0, 0.0)

    monkeypatch.setattr(build, "ATTEMPTS", ((3_000, 0.5), (35_000, 1.0), (70_000, 1.0)))
    monkeypatch.setattr(build, "errors_of", by_size)
    table = with_effect_table(tabulate(extended("analytical", *CASES["linear"])))
    assert table.effects is not None and table.effects.later and table.effects.spline.knots > 10_000
    assert "with later pushes" in table.how


def test_later_pushes_are_not_worth_the_finest_table(monkeypatch: pytest.MonkeyPatch) -> None:
    def by_range(table: EffectTable, *_: object) -> TableAccuracy:
        return TableAccuracy(99.0 if table.later or table.spline.knots < 10_000 else 0.0, 0.0)

    monkeypatch.setattr(build, "ATTEMPTS", ((3_000, 1.0), (4_000, 1.0), (35_000, 1.0)))
    monkeypatch.setattr(build, "errors_of", by_range)
    table, how = build.build_effect_table(extended("analytical", *CASES["linear"]))
    assert table is not None and not table.later
    monkeypatch.setattr(build, "errors_of", lambda *_: TableAccuracy(99.0, 0.0))
    _, how = build.build_effect_table(extended("analytical", *CASES["linear"]))
    assert how.count("a table of") == 4 and how.count("with later pushes") == 2


def test_a_coarse_table_must_be_accurate_to_half_the_tolerances(monkeypatch: pytest.MonkeyPatch) -> None:
    model = extended("analytical", *CASES["constant"])
    monkeypatch.setattr(build, "ATTEMPTS", ((5_000, 1.0),))
    table, _ = build.build_effect_table(model)
    assert table is not None
    samples = accuracy.samples(model, False, accuracy.CHECKED)
    errors = accuracy.errors_of(table, samples, accuracy.MOST)
    for name, error in (("MEAN_TOLERANCE", errors.mean), ("COVARIANCE_TOLERANCE", errors.covariance)):
        with monkeypatch.context() as patch:
            patch.setattr(build, "ATTEMPTS", ((5_000, 0.5),))
            patch.setattr(accuracy, name, 1.9 * error)
            assert build.build_effect_table(model)[0] is None
            patch.setattr(accuracy, name, 2.1 * error)
            assert build.build_effect_table(model)[0] is not None


def test_covariance_that_effects_share_is_in_the_table() -> None:
    plain = extended("analytical", *CASES["constant"], effect("contact_friction", DRIFT))
    assert isinstance(plain.predictor, ExtendedPredictor)
    shared = replace(plain.predictor, cross={(0, 1): np.array([[-0.9 * 0.015**2]])})
    computed = tabulate(replace(plain, predictor=shared))
    table, rows = with_effect_table(computed), inside()
    assert table.effects is not None
    found, exact, apart = (predicted(model, rows) for model in (table, computed, tabulate(plain)))
    difference = relative_error(apart.covariance, exact.covariance)
    assert np.quantile(relative_error(found.covariance, exact.covariance), 0.9) < 0.1 * np.quantile(difference, 0.9)


def test_covariate_beyond_the_training_is_out_of_domain_even_where_the_table_has_its_change() -> None:
    _, table = both("analytical", "step and linear")
    _, step = both("analytical", "step")
    late = with_covariate(inside(8), "elapsed_time", np.full(len(inside(8)), 2000.0))
    found = predicted(step, late)
    assert not found.in_domain.any() and not single(step, late).in_domain[0]
    assert predicted(table, inside(8)).in_domain.all()


def test_changes_end_at_the_largest_that_a_rig_can_have() -> None:
    large = replace(effect("pressure_spread", LATER), coefficients=np.array([-1.6]))  # where -1.0 is possible
    computed = tabulate(extended("analytical", large))
    table, rows = with_effect_table(computed), inside()
    assert table.effects is not None, table.how
    found, exact = predicted(table, rows), predicted(computed, rows)
    assert np.quantile(np.abs(found.mean - exact.mean) / exact.std, 0.95) < 0.1
    largest = predicted(extended("analytical", replace(large, coefficients=np.array([-1.0]))), rows)
    np.testing.assert_allclose(exact.mean, largest.mean, atol=1e-12)


def test_before_a_step_the_prediction_is_that_of_the_base() -> None:
    _, table = both("analytical", "step")
    rows = inside()
    before = rows.covariates["elapsed_time"] < 500.0
    found, plain = predicted(table, rows), predicted(base("analytical"), rows)
    apart = np.abs(found.mean - plain.mean) / plain.std
    assert np.quantile(apart[before], 0.95) < 0.1 and np.median(apart[~before]) > 0.1


@pytest.mark.parametrize("name", BASES)
def test_basis_of_one_push_is_that_of_many(name: str) -> None:
    drivers = {"constant": (), "map": ("a", "b")}.get(name, ("a",))
    basis = DriverBasis(name, drivers, (0.3,) * len(drivers), (1.7,) * len(drivers), 0.5, (0.0, 1.0, 2.0))
    given = {"a": np.array([-0.7, 0.5, 1.0, 2.0]), "b": np.array([1.0, -2.0, 0.1, 3.0])}
    for k, row in enumerate(basis.values(given, 4)):
        assert basis.values_one({key: float(column[k]) for key, column in given.items()}) == pytest.approx(row)


def test_changes_along_a_line_have_one_coordinate_and_round_trip() -> None:
    rng = np.random.default_rng(0)
    along = np.outer(rng.uniform(-1.0, 2.0, 30), [0.6, 0.8, 0.0]) + [0.0, 0.1, 0.5]
    stepped = np.where(np.arange(30)[:, None] < 10, 0.0, [[0.3, 0.0, -0.2]])
    axes = change_axes(stepped, along)
    assert axes is not None and (len(axes.levels), len(axes.directions)) == (2, 1)
    level, places, within = axes.located(stepped, along)
    assert within.all()
    np.testing.assert_allclose(axes.changes(level, places), stepped + along, atol=1e-9)
    for outside in (along + [0.0, 0.0, 0.1], along + 5.0 * np.array([0.6, 0.8, 0.0])):
        assert not axes.located(stepped, outside)[2].any()
    assert not axes.located(stepped + 0.1, along)[2].any()


def test_changes_that_take_too_many_values_have_no_table() -> None:
    rng, none = np.random.default_rng(0), np.zeros((30, 3))
    assert change_axes(none, rng.standard_normal((30, 3))) is None
    assert change_axes(np.arange(30.0)[:, None] % 5 * np.ones((1, 3)), none) is None


def test_inaccurate_table_is_refused_with_its_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accuracy, "MEAN_TOLERANCE", 1e-6)
    monkeypatch.setattr(build, "ATTEMPTS", ((5_000, 1.0),))
    table = with_effect_table(tabulate(extended("analytical", *CASES["constant"])))
    assert table.effects is None
    assert "effects: exact; a table of" in table.how and "standard deviations" in table.how
    for case, tried in (("linear", 2), ("step", 1), ("periodic", 1)):  # two ranges where an effect grows on
        how = with_effect_table(tabulate(extended("analytical", *CASES[case]))).how
        assert how.count("a table of") == tried, how


def test_a_finer_table_is_tried_where_a_coarse_one_is_inaccurate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "ATTEMPTS", ((3_000, 1.0), (35_000, 1.0)))
    monkeypatch.setattr(accuracy, "MEAN_TOLERANCE", 0.3)
    found = with_effect_table(tabulate(extended("analytical", *CASES["linear"])))
    monkeypatch.setattr(build, "ATTEMPTS", ((3_000, 1.0),))
    assert found.effects is not None and found.effects.spline.knots > 15_000, found.how
    monkeypatch.setattr(build, "COARSEST", 9.0)
    assert "too many knots" in with_effect_table(tabulate(extended("analytical", *CASES["linear"]))).how


def test_mechanics_that_depend_on_the_recording_have_no_table() -> None:
    model = extended("analytical", *CASES["constant"])
    needing = replace(model.predictor.effects[0], basis=DriverBasis("linear", ("recording",), (0.0,), (1.0,)))
    rows = replace(model.training, covariates={**model.training.covariates, "recording": np.zeros(len(model.training))})
    model = replace(model, predictor=replace(model.predictor, effects=(needing,)), training=rows)
    assert "depend on the recording" in with_effect_table(tabulate(model)).how


def test_model_without_effects_is_left_as_it_is() -> None:
    plain = tabulate(base("about nothing"))
    assert with_effect_table(plain) is plain


def test_registry_tabulates_effects(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "ATTEMPTS", ((5_000, 1.0),))
    monkeypatch.setattr(accuracy, "MEAN_TOLERANCE", 10.0)
    path = tmp_path / "m.pushmodel"
    extended("about nothing", *CASES["linear"]).save(path)
    registry = ModelRegistry()
    registry.load(path)
    (line,) = registry.answering
    assert "effects: table of" in line and registry.get("").effects is not None


def not_again(*_: object) -> TabulatedModel:
    raise AssertionError("a table was computed")


@pytest.mark.parametrize(
    ("kind", "case", "accurate", "later"),
    [
        ("about mechanics", "linear", True, True),
        ("analytical", "linear", True, True),
        ("analytical", "linear", True, False),
        ("analytical", "linear", False, True),
        ("analytical", "constant", True, False),
        ("analytical", "linear in its coefficients", True, True),
        ("analytical", "linear in its coefficients", True, False),
    ],
)
def test_tables_of_effects_are_kept_and_checked(
    kind: str, case: str, accurate: bool, later: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That there is no accurate table is kept too: to find that out takes longest."""
    if not later:
        refused_later(monkeypatch)
    monkeypatch.setenv("PUSH_PREDICTOR_CACHE", str(tmp_path / "tables"))
    monkeypatch.setattr(build, "ATTEMPTS", ((4_000, 1.0),))
    monkeypatch.setattr(accuracy, "MEAN_TOLERANCE", 10.0 if accurate else 0.0)
    monkeypatch.setattr(accuracy, "COVARIANCE_TOLERANCE", 10.0)
    model, rows = extended(kind, *CASES[case]), inside(5)
    computed = as_served(model)
    assert (computed.effects is not None) is accurate
    assert computed.effects is None or computed.effects.later is later
    with monkeypatch.context() as patch:
        patch.setattr(table_cache, "with_effect_table", not_again)
        kept = as_served(model)
    assert kept.how == computed.how
    for given in (rows, at(rows, 1500.0)):
        one, other = predicted(computed, given), predicted(kept, given)
        assert np.array_equal(one.mean, other.mean) and np.array_equal(one.covariance, other.covariance)
    monkeypatch.setattr(accuracy, "MEAN_TOLERANCE", 1e-9)
    monkeypatch.setattr(table_cache, "with_effect_table", not_again)
    if accurate:
        with pytest.raises(AssertionError, match="a table was computed"):
            as_served(model)
