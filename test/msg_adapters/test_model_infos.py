# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""ModelInfo of a loaded model agrees with the model and with the line of text."""

from __future__ import annotations

from math import inf
from pathlib import Path

import drifting_models
import numpy as np
import pytest
from synthetic import square_pushes, square_rig

from msg_adapters.rigs import model_to_info
from push_predictor.models.store.model_file import save_model
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.nodes.server.services import handle_list_models
from push_predictor_interfaces.srv import ListModels


def test_the_fields_are_those_of_the_model() -> None:
    table, rig = square_pushes(60)
    model = train_model(table, rig, "gp", name="in the file", options=TrainingOptions(mean="zero"))
    info = model_to_info("gp", Path("/models/gp.model"), model, is_default=True)
    assert (info.name, info.file, info.kind, info.is_default) == ("gp", "/models/gp.model", "gp", True)
    assert info.n_train == len(model.training) == 60 and info.n_pushes == len(model.training.pushes)
    assert (info.shape, info.surface, info.pusher_radius) == (rig.shape, rig.surface, rig.pusher_radius)
    assert info.window_duration == model.usual_duration
    np.testing.assert_allclose(info.duration_accepted, [0.9 * table.duration.min(), 1.1 * table.duration.max()])
    np.testing.assert_array_equal(info.velocity_domain, [table.inputs[:, 0].min(), table.inputs[:, 0].max()])
    np.testing.assert_array_equal(info.angle_domain, [table.inputs[:, 2].min(), table.inputs[:, 2].max()])
    assert info.covariates == [] and len(info.covariate_low) == len(info.covariate_high) == 0


def test_an_extended_model_lists_its_covariates_with_unit_and_range() -> None:
    table = drifting_models.pushes(20, 0)
    base = train_model(table, square_rig(), "analytical", name="drifting")
    model = drifting_models.extended(base, drifting_models.slippery(0.1))
    info = model_to_info("drifting", Path("x"), model, is_default=False)
    assert info.covariates == ["elapsed_time"] and info.covariate_units == ["s"] and not info.is_default
    assert list(info.covariate_low) == [0.0] and list(info.covariate_high) == [pytest.approx(1000.0)]
    assert list(info.duration_accepted) == [0.0, inf]


def test_list_models_describes_each_model_in_text_and_fields(tmp_path: Path) -> None:
    table, rig = square_pushes(60)
    for name in ("one", "two"):
        save_model(
            train_model(table, rig, "gp", name=name, options=TrainingOptions(mean="zero")), tmp_path / f"{name}.model"
        )
    registry = ModelRegistry()
    registry.load_all([str(tmp_path)])
    registry.choose_default("two")
    handle_list_models(registry, ListModels.Request(), response := ListModels.Response())
    assert response.success and response.error_code == response.NONE
    assert response.names == [info.name for info in response.models] == ["one", "two"]
    assert [info.is_default for info in response.models] == [False, True] and response.default_model == "two"
    for text, info in zip(response.descriptions, response.models, strict=True):
        assert text.endswith(f"file={info.file}") and f"windows={info.n_train};" in text


def test_list_models_is_empty_without_models() -> None:
    handle_list_models(ModelRegistry(), ListModels.Request(), response := ListModels.Response())
    assert response.success and response.models == [] and response.default_model == ""
