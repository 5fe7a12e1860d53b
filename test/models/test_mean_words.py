# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a model states about its mean and the speeds that it learnt from: repr, info, list_models."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import RADIUS, noisy_pushes, square_pushes, square_rig

from push_predictor.cli import main
from push_predictor.evaluation.metrics import metrics_lines
from push_predictor.evaluation.report.summary import error_sentence
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.push_model import PushModel, mean_in_words, mean_of, mean_parameters
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import empty_table

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
