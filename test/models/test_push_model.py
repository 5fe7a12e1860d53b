# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push models: training, symmetry, domain, requests and files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import noisy_pushes, square_rig, triangle

from push_predictor.errors import ModelFileError, RequestError, TrainingError
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.features import push_features
from push_predictor.models.push_model import KINDS, PushModel
from push_predictor.models.pushes import Pushes
from push_predictor.models.request import PushRequest, check_request, check_requests
from push_predictor.models.store.model_file import is_model_file, load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model, training_rows
from push_predictor.recordings.table import PushTable


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


@pytest.mark.parametrize("kind", KINDS)
def test_covariances_are_positive_definite_in_and_out_of_the_domain(models: dict[str, PushModel], kind: str) -> None:
    rng = np.random.default_rng(3)
    inputs = np.column_stack([rng.uniform(1e-3, 2.0, 10), rng.random(10), rng.uniform(-1.57, 1.57, 10)])
    prediction = models[kind].predict_rows(inputs, np.full(10, 0.2))
    assert np.all(np.linalg.eigvalsh(prediction.covariance) > 0.0)
    assert np.all(np.linalg.eigvalsh(prediction.covariance - prediction.process_covariance) > -1e-15)
    assert not np.all(prediction.in_domain)


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
    table = noisy_pushes(60)
    table.inputs[:, 0] = 0.02
    assert (
        len(
            train_model(
                table, square_rig(), "gp", name="g", options=TrainingOptions(mean="zero")
            ).predictor.scaling.columns
        )
        == 2
    )
    table.outcomes[:, 1] = 0.0
    with pytest.raises(TrainingError, match="dy: does not vary"):
        train_model(table, square_rig(), "gp", name="g", options=TrainingOptions(mean="zero"))
    with pytest.raises(TrainingError, match="'forest' is not accepted"):
        train_model(table, square_rig(), "forest", name="g", options=TrainingOptions(mean="zero"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"velocity": float("nan")}, r"velocity: nan is not accepted, give .* above 0"),
        ({"velocity": -0.1}, "velocity: -0.1"),
        ({"velocity": float("inf")}, "velocity: inf"),
        ({"contact": 1.0}, r"contact: 1.0 .* \[0, 1\)"),
        ({"contact": -1e-9}, "contact"),
        ({"angle": np.pi / 2}, r"angle: 1.57.* \(-pi/2, pi/2\)"),
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
