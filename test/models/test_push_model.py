# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push models: training, symmetry, domain, requests, files, and what they state about themselves."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import drifting_models
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import RADIUS, noisy_pushes, square_pushes, square_rig, triangle

from push_predictor.cli import main
from push_predictor.errors import ModelFileError, RequestError, TrainingError
from push_predictor.evaluation.metrics import metrics_lines
from push_predictor.evaluation.report.summary import error_sentence
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.effects.covariates import UNITS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.features import push_features
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.push_model import KINDS, PushModel, mean_in_words, mean_of, mean_parameters
from push_predictor.models.pushes import Push, Pushes
from push_predictor.models.request import PushRequest, check_request, check_requests, domain_remark, own_window
from push_predictor.models.store.model_file import is_model_file, load_model, save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import TrainingOptions, train_model, training_rows
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.types import Array


@pytest.fixture(scope="module")
def models() -> dict[str, PushModel]:
    return {
        kind: train_model(
            noisy_pushes(75),
            square_rig(),
            kind,
            name=f"a_{kind}",
            sources=["made up"],
            options=TrainingOptions(mean="zero"),
        )
        for kind in KINDS
    }


@pytest.mark.parametrize("kind", KINDS)
def test_model_predicts_new_pushes(models: dict[str, PushModel], kind: str) -> None:
    held_out = noisy_pushes(200, seed=1)
    metrics = metrics_json(compare(models[kind], held_out))
    assert metrics["nmse"]["total"] < 0.6  # three outputs: "predict the mean" scores 3
    assert all(0.8 < share <= 1.0 for share in metrics["coverage"]["0.95"].values())
    assert (metrics["exact_nlpd"] is not None) == (kind in ("gp", "vhgp"))


@settings(max_examples=25, deadline=None)
@given(fraction=st.floats(0.0, 0.99), angle=st.floats(-1.2, 1.2), side=st.integers(1, 3))
def test_four_sides_of_a_square_share_features(
    models: dict[str, PushModel], fraction: float, angle: float, side: int
) -> None:
    one, other = (np.array([[0.02, (k + fraction) / 4.0, angle]]) for k in (0, side))
    for kind in ("vhgp", "gp"):
        a, b = (models[kind].predict_rows(inputs, np.array([0.2])) for inputs in (one, other))
        assert a.mean == pytest.approx(b.mean, abs=1e-9)
        assert a.covariance == pytest.approx(b.covariance, rel=1e-6, abs=1e-15)


def test_circle_has_no_contact_feature_and_ellipse_no_seam() -> None:
    contact = np.array([0.0, 1.0 - 1e-9, 0.5])
    inputs = np.column_stack([np.full(3, 0.02), contact, np.full(3, 0.1)])
    assert push_features(shape_outline("ellip1"), inputs).shape == (3, 2)
    assert np.ptp(push_features(shape_outline("ellip3"), inputs), axis=0) == pytest.approx(0.0, abs=1e-7)


def test_edges_without_symmetry_have_distant_features() -> None:
    starts = triangle().edge_starts
    across = np.array([starts[1] - 1e-9, starts[1] + 1e-9])
    features = push_features(triangle(), np.column_stack([np.full(2, 0.02), across, np.zeros(2)]))
    assert abs(features[1, 1] - features[0, 1]) > 1.0


def test_rows_are_drawn_evenly_over_the_pushes() -> None:
    table = noisy_pushes(3000, windows_per_push=30)
    chosen = table.take(training_rows(table, None, 0))
    counts = [int(np.sum(chosen.push_id == push)) for push in table.pushes]
    assert len(chosen) == 1000 and set(counts) == {10}
    assert len(training_rows(noisy_pushes(200), None, 0)) == 200


def test_a_number_of_rows_is_drawn_by_the_seed() -> None:
    table = noisy_pushes(100)
    again = [training_rows(table, 30, seed).tolist() for seed in (1, 1, 2)]
    assert again[0] == again[1] != again[2]
    with pytest.raises(TrainingError, match=r"n_train: 101 .* 1 to 100"):
        training_rows(table, 101, 0)


def test_constant_inputs_are_dropped_and_constant_outcomes_rejected() -> None:
    table, rig, zero = noisy_pushes(60), square_rig(), TrainingOptions(mean="zero")
    table.inputs[:, 0] = 0.02
    assert len(train_model(table, rig, "gp", name="g", options=zero).predictor.scaling.columns) == 2
    table.outcomes[:, 1] = 0.0
    for kind, message in (("gp", "dy: does not vary"), ("forest", "'forest' is not accepted")):
        with pytest.raises(TrainingError, match=message):
            train_model(table, rig, kind, name="g", options=zero)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"velocity": float("nan")}, r"velocity: nan is not accepted, give .* above 0"),
        ({"velocity": -0.1}, "velocity: -0.1"),
        ({"velocity": float("inf")}, "velocity: inf"),
        ({"contact": 1.0}, r"contact: 1.0 .* \[0, 1\)"),
        ({"contact": -1e-9}, "contact"),
        ({"angle": np.pi / 2}, r"angle: 1.57.* \(-pi/2, pi/2\)"),
        ({"angle": -np.pi / 2}, "angle: -1.57"),
        ({"duration": 0.0}, "duration: 0.0"),
        ({"duration": 1.0}, r"duration: 1.0 .* 0.18 to 0.22 s"),
        ({"covariates": {"topic:/heat": float("nan")}}, "covariate topic:/heat: nan"),
    ],
)
def test_a_bad_request_names_field_value_and_what_is_accepted(
    models: dict[str, PushModel], change: dict[str, object], message: str
) -> None:
    request = {"velocity": 0.02, "contact": 0.1, "angle": 0.2, "duration": 0.2, "covariates": {}}
    check_request(models["vhgp"], PushRequest(**request))
    with pytest.raises(RequestError, match=message):
        check_request(models["vhgp"], PushRequest(**{**request, **change}))


def test_the_first_bad_push_of_a_batch_is_named_by_its_index(models: dict[str, PushModel]) -> None:
    inputs = np.tile([0.02, 0.1, 0.2], (5, 1))
    inputs[3, 1] = 1.2
    with pytest.raises(RequestError, match=r"contact\[3\]: 1.2"):
        check_requests(models["gp"], inputs, 0.2, {})


def test_analytical_model_accepts_any_duration(models: dict[str, PushModel]) -> None:
    check_request(models["analytical"], PushRequest(0.02, 0.1, 0.0, 6.0))


# --- files ----------------------------------------------------------------------------------------------------------


def test_rejects_file_of_another_kind(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("not a model")
    np.savez(tmp_path / "arrays.npz", a=np.zeros(3))
    for name in ("text", "arrays.npz"):
        assert not is_model_file(tmp_path / name)
        with pytest.raises(ModelFileError, match=name):
            load_model(tmp_path / name)
    with pytest.raises(ModelFileError, match="absent"):
        load_model(tmp_path / "absent")


def test_failed_save_keeps_the_old_file(models: dict[str, PushModel], tmp_path: Path) -> None:
    save_model(models["gp"], tmp_path / "m")
    before = (tmp_path / "m").read_bytes()
    (tmp_path / "m.d").mkdir()
    with pytest.raises(OSError, match=r"m\.d"):
        save_model(models["vhgp"], tmp_path / "m.d")
    assert (tmp_path / "m").read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m", "m.d"]


def test_a_thousand_windows_make_a_small_file(tmp_path: Path) -> None:
    table = noisy_pushes(1000)
    covariates = {f"covariate {k}": np.random.default_rng(k).random(1000) for k in range(11)}
    full = PushTable(table.inputs, table.duration, table.outcomes, table.push_id, covariates)
    save_model(train_model(full, square_rig(), "analytical", name="a"), tmp_path / "m")
    with_sites = (tmp_path / "m").stat().st_size + 3 * 1000 * 8  # which a VHGP stores in addition
    assert with_sites < 200_000


@pytest.mark.parametrize("name", ["n_train", "inducing"])
def test_training_options_reject_counts_below_one(name: str) -> None:
    with pytest.raises(TrainingError, match=f"{name}: 0 is not accepted, give 1 or more"):
        TrainingOptions(**{name: 0})


def test_a_push_without_a_finite_prediction_is_an_error_that_names_it() -> None:
    model = train_model(noisy_pushes(40), square_rig(), "analytical", name="a")
    broken = replace(model, predictor=replace(model.predictor, covariance=np.full((3, 3), np.nan)))
    with pytest.raises(RequestError, match=r"velocity\[0\].*too far from the training data"):
        broken.predict(Pushes(velocity=0.02, contact=[0.1, 0.2], angle=0.3))


# --- pushes as a user states them ---


VELOCITIES = st.lists(st.floats(1e-3, 0.2), min_size=1, max_size=5)


def test_scalars_make_one_push_of_default_duration():
    pushes = Pushes(0.02, 0.1, 0.3)
    np.testing.assert_array_equal(pushes.inputs, [[0.02, 0.1, 0.3]])
    np.testing.assert_array_equal(pushes.duration, [0.2])
    assert len(pushes) == 1 and pushes.covariates == {}


@given(VELOCITIES, st.sampled_from([list, tuple, np.array]))
def test_lists_tuples_and_arrays_mean_the_same_and_scalars_apply_to_all(
    velocity: list[float], kind: Callable[..., object]
):
    pushes = Pushes(kind(velocity), 0.1, angle=[0.3], duration=0.1, covariates={"dwell_time": 2})
    np.testing.assert_array_equal(pushes.inputs, [[v, 0.1, 0.3] for v in velocity])
    np.testing.assert_array_equal(pushes.duration, np.full(len(velocity), 0.1))
    np.testing.assert_array_equal(pushes.covariates["dwell_time"], np.full(len(velocity), 2.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("fast", 0.1, 0.3), r"velocity: \"'fast'\" is not accepted, give a number or a list of numbers"),
        ((0.02, np.nan, 0.3), "contact: nan is not accepted, give a finite number"),
        ((0.02, [0.1, np.inf], 0.3), r"contact\[1\]: inf is not accepted"),
        ((0.02, 0.1, np.zeros((2, 2))), r"angle: 'an array of shape \(2, 2\)' is not accepted"),
        (([0.02, 0.03], [0.1, 0.2, 0.3], 0.3), "velocity: '2 numbers' .* give one number, or 3 as in contact"),
        ((0.02, [], 0.3), "contact: 'an empty list' is not accepted, give at least one number"),
        ((0.02, 0.1, 0.3, [0.2, 0.1], {"dwell_time": [1, 2, 3]}), "duration: '2 numbers'"),
        ((0.02, 0.1, 0.3, 0.2, {"dwell_time": None}), "covariate dwell_time"),
        ((0.02, 0.1, 0.3, 0.2, {"dwell_time": np.nan}), "covariate dwell_time: nan is not accepted"),
    ],
)
def test_rejects_invalid_push_by_field_and_value(arguments: tuple[Any, ...], message: str):
    with pytest.raises(RequestError, match=message):
        Pushes(*arguments)


# --- why a push is outside the domain ---


@pytest.fixture(scope="module")
def gp() -> PushModel:
    return train_model(*square_pushes(60), "gp", name="gp")


def remark(gp: PushModel, inputs: Array, **covariates: Array) -> str:
    push = Push(inputs, np.full(len(inputs), 0.2), covariates)
    return domain_remark(gp, push, gp.predict_rows(inputs, push.duration, covariates).in_domain)


def test_a_remark_counts_the_pushes_outside_and_names_value_and_range_of_the_first(gp: PushModel) -> None:
    known, limits = gp.training.inputs, gp.input_limits
    assert remark(gp, known) == remark(gp, np.empty((0, 3))) == ""
    for column, value, name in ((0, 0.5, "velocity"), (0, 1e-4, "velocity"), (2, -1.5, "angle")):
        pushes = known[:5].copy()
        pushes[[2, 4], column] = value
        unit, (low, high) = UNITS[name], getattr(limits, name)
        assert (low, high) == (known[:, column].min(), known[:, column].max())
        said = f"{name} {value:.4g} {unit}, training covers {low:.4g} to {high:.4g} {unit}"
        assert remark(gp, pushes) == f"out of domain: 2 of 5 pushes, first push 2: {said}"
        assert remark(gp, pushes[2:3]) == f"out of domain: {said}"


def test_a_contact_without_training_pushes_is_named() -> None:
    table, rig = square_pushes(60)
    half = table.take(np.flatnonzero(table.inputs[:, 1] % 0.25 < 0.12))  # the first half of each side
    gp = train_model(half, rig, "gp", name="half", options=TrainingOptions(mean="zero"))
    inside = half.inputs[:1].copy()
    inside[0, 1] = 0.2
    assert remark(gp, inside) == "out of domain: contact 0.2, beyond those of the training pushes"


def test_a_covariate_outside_its_range_is_named_with_its_unit_and_an_edge_for_any_push_of_a_batch() -> None:
    table = drifting_models.pushes(20, 0)
    half = table.take(np.flatnonzero(table.inputs[:, 1] < 0.5))
    base, slippery = train_model(half, square_rig(), "analytical", name="half"), drifting_models.slippery(0.1)
    drifting, inputs = drifting_models.extended(base, slippery), half.inputs[:2].copy()
    assert remark(drifting, inputs[:1], elapsed_time=np.array([400.0])) == ""
    late = remark(drifting, inputs[:1], elapsed_time=np.array([2000.0]))
    assert re.fullmatch(r"out of domain: covariate elapsed_time 2000 s, training covers \S+ to \S+ s", late)
    by_edge = replace(slippery, basis=DriverBasis("category", ("edge",), levels=(0.0, 1.0)))
    inputs[1, 1] = 0.8
    expected = "out of domain: 1 of 2 pushes, first push 1: covariate edge 3, training covers 0 to 1"
    assert remark(drifting_models.extended(base, by_edge), inputs) == expected


def test_duration_zero_means_the_models_own_window(gp: PushModel) -> None:
    assert own_window(gp, 0.0) == gp.usual_duration == pytest.approx(np.median(gp.training.duration))
    assert own_window(gp, 0.19) == 0.19 and own_window(gp, -0.2) == -0.2


# --- what a model states about its mean and speeds ---


VALUES = {"contact_friction": 0.25, "rim_exponent": 1.5}
MECHANICS = FittedMechanics(PushMechanics(square_rig().outline, RADIUS), VALUES, 1e-4 * np.eye(2))


@cache
def trained(kind: str, **options: Any) -> PushModel:
    table = empty_table() if kind == "prior" else square_pushes(30)[0]
    return train_model(table, square_rig(), kind, name="m", options=TrainingOptions(**{"mean": "zero", **options}))


def test_a_model_states_its_mean_and_parameters() -> None:
    assert mean_in_words(trained("gp").predictor) == "zero"
    assert mean_in_words(trained("gp", per_path=False).predictor) == "zero, not per path length"
    about = trained("gp", about=MECHANICS).predictor
    assert mean_in_words(about) == "fitted mechanics (contact_friction 0.25, rim_exponent 1.5)"
    assert mean_in_words(trained("analytical").predictor) == "textbook mechanics"
    prior = trained("prior").predictor
    assert mean_of(prior) == "mechanics with uncertain parameters" and mean_parameters(prior)["contact_friction"] == 0.3


def test_info_and_registry_state_mean_and_speeds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "m.pushmodel"
    trained("gp", about=MECHANICS).save(path)
    assert main(["info", str(path), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["mean"] == "fitted mechanics" and found["mean_parameters"] == VALUES
    assert found["velocity_range"] == pytest.approx([0.02, 0.02])
    registry = ModelRegistry()
    registry.load(path)
    stated = dict(pair.split("=", 1) for pair in registry.describe("m").split("; "))
    assert stated["mean"] == "fitted mechanics (contact_friction 0.25, rim_exponent 1.5)"
    assert stated["speeds"] == "20..20 mm/s" and list(stated)[-1] == "file"


def test_without_training_the_nmse_is_not_about_a_training_mean() -> None:
    test = noisy_pushes(6)
    before, after = (metrics_json(compare(trained(kind), test)) for kind in ("prior", "gp"))
    for metrics, reference in ((before, "predicting no motion"), (after, "the training mean")):
        text = "\n".join(metrics_lines(metrics))
        assert f"1 is no better than {reference}" in text and f"so 3 for {reference}" in text
        assert error_sentence(metrics).endswith(f"3 is {reference}.")
