# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The report of an extended model: its maps are drawn at covariates that are named."""

from __future__ import annotations

import html
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from repository import BAGS

from push_predictor.evaluation.report.maps import (
    fine_cells,
    fixed_covariates,
    fixed_covariates_text,
    map_covariates,
    push_map,
)
from push_predictor.evaluation.report.page import SECTIONS, write_validation_report
from push_predictor.evaluation.validation import compare
from push_predictor.geometry.frames import wrap_angle
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.table import PushTable

BAG = BAGS / "hexagon_delrin"
DRIFT = DriverBasis("linear", ("elapsed_time",), (30.0,), (20.0,))
AHEAD = DriverBasis("periodic", ("push_heading",))


def slippery() -> Effect:
    """A contact friction that changes by 0.2 in 20 s."""
    return Effect("contact_friction", "elapsed_time", DRIFT, np.array([0.2]), np.array([[0.01]]), np.ones(3))


def grain() -> Effect:
    predictor = "anisotropic_friction", "push_heading", DriverBasis("constant")
    return Effect(*predictor, np.array([0.2, 0.1]), 1e-3 * np.eye(2), np.ones(3))


def headed() -> Effect:
    """A contact friction that differs with the heading of the push."""
    return Effect("contact_friction", "push_heading", AHEAD, np.array([0.1, 0.1]), 1e-4 * np.eye(2), np.ones(3))


@pytest.fixture(scope="module")
def table() -> PushTable:
    return load_data([BAG])


@pytest.fixture(scope="module")
def base(table: PushTable) -> PushModel:
    return train_model(table, load_rig_for([BAG]), "analytical", name="plain")


def extended(base: PushModel, *effects: Effect) -> PushModel:
    predictor = ExtendedPredictor(base.predictor.base, effects, np.ones(3))
    return replace(base, name="extended", predictor=predictor)


def test_map_is_drawn_at_the_median_of_the_covariates(base: PushModel, table: PushTable) -> None:
    model, cells = extended(base, slippery(), grain()), fine_cells(base.rig.outline, table)
    fixed = fixed_covariates(model, table)
    times = table.covariates["elapsed_time"]
    assert set(fixed) == {"elapsed_time", "slider_heading"}
    assert fixed["elapsed_time"] in times and 0.4 < np.mean(times <= fixed["elapsed_time"]) < 0.6
    shown = push_map(model, 0.02, 0.2, cells, fixed)
    contact = cells.contact[7:9].mean() / base.rig.outline.perimeter
    inputs = np.array([[0.02, contact, cells.angle[20:22].mean()]])
    columns = {name: np.array([value]) for name, value in fixed.items()}
    expected = model.predict_rows(inputs, np.array([0.2]), columns)
    assert expected.in_domain[0]
    np.testing.assert_allclose(shown.mean[20, 7], expected.mean[0], rtol=1e-9)
    np.testing.assert_allclose(shown.sd[20, 7] ** 2, np.diag(expected.covariance[0]), rtol=1e-9)


def test_map_outside_the_covariate_range_is_empty_and_its_caption_states_why(base: PushModel, table: PushTable) -> None:
    model, cells = extended(base, slippery()), fine_cells(base.rig.outline, table)
    fixed = {"elapsed_time": 1e4}
    assert np.isnan(push_map(model, 0.02, 0.2, cells, fixed).mean).all()
    assert "Nothing is drawn: the model was extended on elapsed_time from " in fixed_covariates_text(model, fixed)


def test_push_heading_follows_from_the_slider_heading(base: PushModel, table: PushTable) -> None:
    model = extended(base, headed())
    assert model.needs == ("push_heading",)
    fixed = fixed_covariates(model, table)
    assert list(fixed) == ["slider_heading"]
    inside = {**fixed, "slider_heading": table.covariates["slider_heading"]}
    for row in range(0, len(table), 7):
        one = {name: float(np.atleast_1d(column)[row]) for name, column in inside.items()}
        found = map_covariates(base.rig.outline, one, table.inputs[[row]])["push_heading"][0]
        assert abs(wrap_angle(found - table.covariates["push_heading"][row])) < 1e-9
    assert "(push_heading follows from it). At another heading the map differs." in fixed_covariates_text(model, fixed)
    lacking = replace(table.take(np.arange(4)), covariates={"push_heading": np.array([3.1, -3.1, 3.0, 0.0])})
    assert fixed_covariates(model, lacking) == {"push_heading": 3.1}


def test_model_without_extension_fixes_no_covariate(base: PushModel, table: PushTable) -> None:
    assert fixed_covariates(base, table) == {} and fixed_covariates_text(base, {}) == ""


def test_report_of_an_extended_model_names_the_covariates_of_its_maps(
    base: PushModel, table: PushTable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("push_predictor.evaluation.report.page.SECTIONS", SECTIONS[:1])  # the maps
    monkeypatch.setattr("push_predictor.evaluation.report.maps.FINE", 12)
    model = extended(base, slippery(), grain())
    both = [model, replace(base, name="plain")]
    written = write_validation_report(tmp_path, "", table, None, both, [compare(m, table) for m in both], {}, [])
    page = html.unescape(written.read_text())
    time = fixed_covariates(model, table)["elapsed_time"]
    assert page.count(f"The map of extended is drawn at elapsed_time {time:.3g} s and slider_heading ") == 2
    assert "the first of the 6 equal sides is drawn." in page
    assert "The map of plain" not in page
