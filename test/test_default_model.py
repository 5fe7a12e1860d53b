"""The model that ships with the package: where it comes from, and that it is what it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from push_predictor.errors import ModelFileError
from push_predictor.models import default_model
from push_predictor.models.default_model import default_model_path
from push_predictor.models.model_file import load_model
from push_predictor.models.train import training_rows
from push_predictor.recordings.load import load_data

ROOT = Path(__file__).resolve().parents[1]


def test_it_was_trained_on_the_simulators_recording_and_nothing_else():
    model = load_model(default_model_path())
    assert model.provenance.sources == ("square_abs_train",)
    windows = load_data([ROOT / "bags" / "square_abs_train"])
    rows = windows.take(training_rows(windows, None, model.provenance.seed))
    np.testing.assert_allclose(model.training.outcomes, rows.outcomes, rtol=1e-9)
    assert model.provenance.pushes == len(rows.pushes)


def test_its_covariances_are_full():
    model = load_model(default_model_path())
    covariance = model.predict(model.training.inputs, model.training.duration).covariance
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert np.abs(covariance[:, 0, 1] / (sd[:, 0] * sd[:, 1])).max() > 0.3


def test_where_it_is_missing_the_places_are_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(default_model, "DEFAULT_MODEL", "absent.pushmodel")
    with pytest.raises(ModelFileError, match="resource"):
        default_model_path()
