# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What ships with the package: where it is found, and that the model is what it says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from repository import REPOSITORY

from push_predictor.cli import main
from push_predictor.errors import PushPredictorError
from push_predictor.models.store.model_file import load_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import training_rows
from push_predictor.recordings.load import load_data
from push_predictor.resources import DEFAULT_MODEL, SHIPPED, share_path

PREDICT = ["predict", "default", "--velocity", "0.02", "--contact", "0.1", "--angle", "0.3"]


@pytest.mark.slow
def test_it_was_trained_on_the_simulators_recording_and_nothing_else():
    model = load_model(share_path(*DEFAULT_MODEL))
    assert model.provenance.sources == ("square_abs_train",)
    windows = load_data([REPOSITORY / "bags" / "square_abs_train"])
    rows = windows.take(training_rows(windows, None, model.provenance.seed))
    np.testing.assert_allclose(model.training.outcomes, rows.outcomes, rtol=1e-9)
    assert model.provenance.pushes == len(rows.pushes)


def test_its_covariances_are_full():
    model = load_model(share_path(*DEFAULT_MODEL))
    covariance = model.predict_rows(model.training.inputs, model.training.duration).covariance
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert np.abs(covariance[:, 0, 1] / (sd[:, 0] * sd[:, 1])).max() > 0.3


@pytest.mark.parametrize("words", [PREDICT, ["info", "default"]])
def test_it_has_a_name_for_commands_for_python_and_for_the_registry(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    stem = share_path(*DEFAULT_MODEL).stem
    assert main([*words, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["model"] == load_model(SHIPPED).name == stem
    registry = ModelRegistry()
    assert registry.load(Path(SHIPPED)) == stem and registry.file(stem) == share_path(*DEFAULT_MODEL)


def test_a_file_of_an_installation_is_found_by_its_prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    installed = tmp_path / "overlay" / "share" / "push_predictor" / "config" / "only_installed.yaml"
    installed.parent.mkdir(parents=True)
    installed.touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'overlay'}")
    assert share_path("config", "only_installed.yaml") == installed


def test_where_a_file_is_missing_the_places_are_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", "/overlay")
    with pytest.raises(PushPredictorError, match=r"resource/absent\.pushmodel: .*/overlay/share/push_predictor"):
        share_path("resource", "absent.pushmodel")
