# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What ships with the package: where it is found, and that the model is what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from repository import REPOSITORY

from push_predictor.errors import PushPredictorError
from push_predictor.models.store.model_file import load_model
from push_predictor.models.train import training_rows
from push_predictor.recordings.load import load_data
from push_predictor.resources import DEFAULT_MODEL, share_path


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
