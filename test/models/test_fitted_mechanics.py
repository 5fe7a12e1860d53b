# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models of fitted mechanics: what they need, their supports, how they are saved, extended and retrained."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import square_pushes

from push_predictor.api import train
from push_predictor.errors import RequestError
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import Provenance, PushModel
from push_predictor.models.pushes import Push, Pushes
from push_predictor.models.train import retrain_model
from push_predictor.models.train_mechanics import on_supports, predictor_about
from push_predictor.recordings.load import different_supports, load_data
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import write_table
from push_predictor.types import Array

CORNERS = np.array([[0.04, 0.04, 0.25], [-0.04, 0.04, 0.25], [-0.04, -0.04, 0.25], [0.04, -0.04, 0.25]])
MIDDLE = CORNERS * [0.25, 0.25, 1.0]
ON_CORNERS, IN_MIDDLE = supported_at(CORNERS), supported_at(MIDDLE)


def mechanics_model(values: dict[str, float], **covariates: Array) -> PushModel:
    """A model of 24 windows; with the covariate `recording`, recordings 0 and 1 have known supports."""
    table, rig = square_pushes(24)
    table = replace(table, covariates=covariates)
    supports = {0: ON_CORNERS, 1: IN_MIDDLE} if "recording" in covariates else {}
    mechanics = PushMechanics(rig.outline, rig.pusher_radius, None, supports)
    fitted = FittedMechanics(mechanics, values, 1e-4 * np.eye(len(values)))
    return PushModel("m", "analytical", rig, predictor_about(fitted, table), table, Provenance((), 8, 0, "0"))


@pytest.fixture(scope="module")
def by_recording() -> PushModel:
    return mechanics_model({"contact_friction": 0.2}, recording=np.arange(24.0) % 2)


def test_needs_the_covariates_of_its_parameters() -> None:
    model = mechanics_model({"grain_x": 0.3}, push_heading=np.linspace(-3.0, 3.0, 24))
    assert model.needs == ("push_heading",)
    with pytest.raises(RequestError, match="push_heading"):
        model.predict(Pushes(0.02, 0.1, 0.2))
    along, across = (model.predict(Pushes(0.02, 0.1, 0.2, covariates={"push_heading": h})).mean for h in (0.0, 1.5))
    assert not np.allclose(along, across)


@pytest.mark.parametrize(
    ("values", "covariates"),
    [
        ({"grain_x": 0.3}, {"push_heading": np.linspace(0.0, 0.5, 24)}),
        ({"contact_friction": 0.2}, {"recording": np.zeros(24)}),
    ],
    ids=["push_heading", "recording"],
)
def test_the_domain_is_that_of_the_headings_and_recordings_of_training(
    values: dict[str, float], covariates: dict[str, Array]
) -> None:
    model = mechanics_model(values, **covariates)
    (name,) = covariates
    pushes = Pushes(0.02, 0.3, 0.2, covariates={name: [0.0, 1.0]})
    assert model.predict(pushes).in_domain.tolist() == [True, False]


def test_support_of_the_recording_is_used(by_recording: PushModel) -> None:
    assert by_recording.needs == ("recording",)
    push = Pushes(0.02, 0.05, 0.0, covariates={"recording": [0.0, 1.0]})
    wide, narrow = abs(by_recording.predict(push).mean[:, 2])
    assert narrow > 2.0 * wide


def test_model_of_several_supports_takes_those_of_other_recordings(by_recording: PushModel) -> None:
    push = Pushes(0.02, 0.05, 0.0, covariates={"recording": 1.0})
    narrow = by_recording.predict(push).mean
    alone = on_supports(by_recording, replace(by_recording.rig, support_points=MIDDLE), {})
    assert alone.needs == ()
    np.testing.assert_allclose(alone.predict(Pushes(0.02, 0.05, 0.0)).mean, narrow)
    moved = on_supports(by_recording, by_recording.rig, {5: MIDDLE})
    fifth = Pushes(0.02, 0.05, 0.0, covariates={"recording": 5.0})
    np.testing.assert_allclose(moved.predict(fifth).mean, narrow)
    assert on_supports(mechanics_model({}), replace(by_recording.rig, support_points=MIDDLE), {}).needs == ()


def test_retraining_keeps_the_parameters_and_estimates_the_noise_again() -> None:
    model = mechanics_model({"contact_friction": 0.2})
    table = replace(model.training, outcomes=model.training.outcomes + np.array([1e-3, 0.0, 0.0]))
    again = retrain_model(model, table).predictor
    assert isinstance(again, MechanicsPredictor) and isinstance(model.predictor, MechanicsPredictor)
    assert again.fitted is model.predictor.fitted
    assert again.covariance[0, 0] > 10.0 * model.predictor.covariance[0, 0]


def test_ellipsoid_has_the_friction_and_the_pressure_of_the_mechanics(by_recording: PushModel) -> None:
    assert by_recording.predictor.mechanics.value("contact_friction") == 0.2
    assert by_recording.predictor.mechanics.ellipsoid.length == pytest.approx(
        0.5 * (ON_CORNERS.length + IN_MIDDLE.length)
    )
    shifted = mechanics_model({"centre_x": 0.002, "rim_exponent": 3.0}).predictor.mechanics.ellipsoid
    assert shifted.centre == pytest.approx((0.002, 0.0), abs=1e-12)
    assert shifted.length > 1.1 * mechanics_model({}).predictor.mechanics.ellipsoid.length


def test_each_change_of_the_rim_is_on_surfaces_of_its_own() -> None:
    model = mechanics_model({})
    push, even = Push.of(model.training), model.predictor.mechanics
    still = even.displacement(push.inputs, push.duration)
    for exponent in (0.5, 7.0):
        shift = even.shifted(("rim_exponent",), np.full((len(still), 1), exponent), push)[0]
        moved = mechanics_model({"rim_exponent": exponent}).predictor.mechanics.displacement(push.inputs, push.duration)
        np.testing.assert_allclose(still + shift, moved, rtol=0.0, atol=1e-15)
    half = np.where(np.arange(len(still)) < 12, 7.0, 0.0)[:, None]  # at once with none, on the surfaces of both
    np.testing.assert_allclose(even.shifted(("rim_exponent",), half, push)[0][:12], shift[:12], rtol=0.0, atol=1e-15)


# --- recordings whose rigs have different support points ---


@pytest.fixture
def tables(tmp_path: Path) -> list[Path]:
    """Two tables of the same slider, on points at its corners and in its middle, with friction 0.15."""
    paths = []
    for seed, points in enumerate((CORNERS, MIDDLE)):
        table, rig = square_pushes(18, seed)
        mechanics = PushMechanics(rig.outline, rig.pusher_radius, supported_at(points))
        outcomes = mechanics.displacement({"contact_friction": 0.15}, table.inputs, table.duration)
        outcomes += np.random.default_rng(seed).normal(0.0, [1e-5, 1e-5, 1e-3], (18, 3))
        paths.append(tmp_path / f"{seed}.csv")
        write_table(paths[-1], replace(table, outcomes=outcomes))
        save_rig(replace(rig, support_points=points), tmp_path / f"{seed}.rig.yaml")
    return paths


def test_fit_uses_the_support_of_each_recording(tables: list[Path]) -> None:
    model = train(tables, kind="analytical", fit=True, watch=lambda stage, done: None)
    assert model.needs == ("recording",)
    assert isinstance(model.predictor, MechanicsPredictor)
    assert model.predictor.fitted.values["contact_friction"] == pytest.approx(0.15, abs=0.02)
    assert np.sqrt(model.predictor.covariance[2, 2]) < 2e-3


def test_supports_are_numbered_by_path_if_they_differ(tables: list[Path]) -> None:
    first, second = (different_supports(tables)[number] for number in (0, 1))
    np.testing.assert_allclose(first, CORNERS)
    np.testing.assert_allclose(second, MIDDLE)
    assert different_supports([tables[0], tables[0]]) == {}
    assert load_data(tables, numbered=True).covariates["recording"].tolist() == [0.0] * 18 + [1.0] * 18
    assert "recording" not in load_data(tables).covariates
