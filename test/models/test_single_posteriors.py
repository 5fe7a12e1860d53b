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

"""Single pushes outside the domain: as the model predicts them, at a fraction of its cost."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from synthetic import triangle

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.features import push_features
from push_predictor.models.gaussian_process.constant import fit_constant
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.predictors.correlation import Correlation
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.single_record import single_from, single_record
from push_predictor.models.store.table_file import read_tables, write_tables
from push_predictor.models.tabulated.single_push import posteriors as module
from push_predictor.models.tabulated.single_push.posteriors import SinglePosteriors, accuracy_of, single_posteriors
from push_predictor.models.tabulated.table_accuracy import (
    COVARIANCE_TOLERANCE,
    MEAN_TOLERANCE,
    STEEPEST,
    compared_with,
    outside_pushes,
)
from push_predictor.models.tabulated.tabulated_model import tabulate, with_single_posteriors
from push_predictor.models.train import train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable

OUTLINES = {
    "square": shape_outline("rect1"),
    "ellipse": shape_outline("ellip3"),
    "circle": shape_outline("ellip1"),
    "triangle": triangle(),
}
NOISE = np.array([[1e-4, 0.0, 0.0], [0.0, 1e-4, 3e-3], [0.0, 0.0, 4e-3]])


@cache
def trained(shape: str, kind: str, n: int = 80) -> PushModel:
    """Trained on pushes at angles of up to 1 rad, with correlated noise that depends on the angle."""
    rig, draw = Rig(shape, OUTLINES[shape], 0.00475, "abs", 0.8), np.random.default_rng(3)
    inputs = draw.uniform([0.01, 0.0, -1.0], [0.05, 1.0, 1.0], (n, 3))
    duration = np.full(n, 0.2)
    outcomes = AnalyticalPush(rig.outline, rig.pusher_radius).displacement(inputs, duration)
    outcomes += draw.normal(size=(n, 3)) @ NOISE * (0.3 + np.abs(inputs[:, 2:]))
    table = PushTable(inputs, duration, outcomes, np.array([f"p{k // 4}" for k in range(n)]))
    model = train_model(table, rig, kind, name=kind)
    assert isinstance(model.predictor, GaussianProcessPredictor)
    features = model.predictor.regressions[0].inputs
    correlation = Correlation(features, draw.standard_normal((n, 3)) + [[0.5]] * n, 0.5, 2.0)
    return replace(model, predictor=replace(model.predictor, correlation=correlation))


@pytest.mark.parametrize("kind", ["gp", "vhgp"])
@pytest.mark.parametrize("shape", OUTLINES)
def test_a_single_push_outside_the_domain_is_predicted_as_by_the_model(shape: str, kind: str) -> None:
    model = trained(shape, kind)
    tabulated = with_single_posteriors(tabulate(model))
    assert tabulated.single is not None
    inputs = outside_pushes(model, 30)
    exact = model.predict_rows(inputs, np.full(len(inputs), 0.2))
    alone = [tabulated.predict_rows(inputs[k : k + 1], np.array([0.2])) for k in range(len(inputs))]
    mean, covariance, process = (
        np.concatenate([getattr(each, name) for each in alone]) for name in ("mean", "covariance", "process_covariance")
    )
    error = compared_with(exact, mean, covariance, process)
    assert error.mean < MEAN_TOLERANCE and error.covariance < COVARIANCE_TOLERANCE
    assert not any(each.in_domain[0] for each in alone) and all(each.tails == exact.tails for each in alone)
    assert np.all(np.linalg.eigvalsh(covariance) > 0.0)


def test_the_mean_is_exact() -> None:
    model = trained("square", "vhgp")
    found = single_posteriors(model)
    assert found is not None and accuracy_of(found, model).mean < 1e-8


def test_independent_outputs_have_no_covariance() -> None:
    model = trained("square", "vhgp")
    apart = replace(model, predictor=model.predictor.with_independent_outputs())
    found = single_posteriors(apart)
    assert found is not None
    numbers = np.array(found.moments([0.02, 0.3, 1.4]))[3:].reshape(2, 3, 3)
    assert np.all(numbers * (1.0 - np.eye(3)) == 0.0) and np.all(numbers[0] >= numbers[1])


def with_a_constant_output() -> PushModel:
    """A model whose second output has constant noise."""
    model = trained("square", "gp")
    predictor = model.predictor
    assert isinstance(predictor, GaussianProcessPredictor)
    first, second, third = predictor.regressions
    constant = fit_constant(second.inputs, second.outputs, heavy_tails=True)
    return replace(model, predictor=replace(predictor, regressions=(first, constant, third)))


def test_an_output_of_constant_noise_is_the_same_everywhere() -> None:
    mixed = with_a_constant_output()
    found = single_posteriors(mixed)
    assert found is not None and accuracy_of(found, mixed).accepted


def test_what_is_too_far_off_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    model = trained("square", "vhgp")
    monkeypatch.setattr(module, "NEGLIGIBLE", 10.0)
    assert single_posteriors(model) is None
    tabulated = with_single_posteriors(tabulate(model))
    push = outside_pushes(model, 1)
    exact = model.predict_rows(push, np.array([0.2]))
    assert np.array_equal(tabulated.predict_rows(push, np.array([0.2])).mean, exact.mean)


def test_comparison_covers_all_that_differs() -> None:
    model = trained("square", "vhgp")
    found, predictor = single_posteriors(model), model.predictor
    assert found is not None and isinstance(predictor, GaussianProcessPredictor)
    scaled = replace(predictor, scaling=replace(predictor.scaling, outcome_mean=predictor.scaling.outcome_mean + 1e-4))
    shifted = SinglePosteriors(scaled, found.regressions)
    assert not accuracy_of(shifted, model).accepted


@pytest.mark.parametrize("wrong", ["covariance", "process_covariance"])
def test_both_covariances_are_compared(wrong: str) -> None:
    model = trained("square", "gp")
    inputs = outside_pushes(model, 3)
    exact = model.predict_rows(inputs, np.full(3, 0.2))
    both = {
        name: getattr(exact, name) * (1.02 if name == wrong else 1.0) for name in ("covariance", "process_covariance")
    }
    assert compared_with(exact, exact.mean, **both).covariance == pytest.approx(0.02)


def test_pushes_outside_are_of_all_kinds() -> None:
    model = trained("square", "gp")
    inputs = outside_pushes(model, 200)
    assert len(inputs) == 200 and not model.in_domain(inputs).any()
    speed, known = inputs[:, 0], model.training.inputs[:, 0]
    assert speed.min() < known.min() and known.max() < speed.max() < 2.0 * known.max()
    assert -STEEPEST < inputs[:, 2].min() < -1.2 and 1.2 < inputs[:, 2].max() < STEEPEST < np.pi / 2.0


def test_a_model_without_a_table_keeps_its_own_predictions() -> None:
    analytical = train_model(trained("square", "gp").training, trained("square", "gp").rig, "analytical", name="a")
    assert with_single_posteriors(tabulate(analytical)).single is None and single_posteriors(analytical) is None


@pytest.mark.parametrize("kind", ["gp", "vhgp"])
def test_posteriors_of_a_file_predict_the_same(kind: str, tmp_path: Path) -> None:
    model = trained("square", kind)
    written = with_single_posteriors(tabulate(model))
    write_tables(tmp_path / "tables", "digest", written)
    read = read_tables(tmp_path / "tables", "digest", model)
    assert read is not None and read.single is not None and written.single is not None
    for row in push_features(model.rig.outline, outside_pushes(model, 20)).tolist():
        assert read.single.moments(row) == written.single.moments(row)


def test_an_output_of_constant_noise_has_no_arrays_in_the_file() -> None:
    mixed = with_a_constant_output()
    found = single_posteriors(mixed)
    assert found is not None and isinstance(mixed.predictor, GaussianProcessPredictor)
    record = single_record(found, arrays := {})
    assert record[1] is None and not any(name.startswith("single_1") for name in arrays)
    assert single_from(mixed.predictor, record, arrays).moments([0.02, 0.3, 1.4]) == found.moments([0.02, 0.3, 1.4])


def test_posteriors_that_predict_otherwise_are_not_read(tmp_path: Path) -> None:
    model = trained("square", "vhgp")
    served = with_single_posteriors(tabulate(model))
    assert served.single is not None
    signal = served.single.regressions[0].signal  # type: ignore[union-attr]  # not constant
    signal.weights[:] *= 1.01
    write_tables(tmp_path / "tables", "digest", served)
    assert read_tables(tmp_path / "tables", "digest", model) is None
