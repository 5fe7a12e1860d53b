# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Training on recordings whose rigs have different support points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import square_pushes

from push_predictor.api import train
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.recordings.load import different_supports, load_data
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import write_table

pytestmark = pytest.mark.slow

CORNERS = np.array([[0.04, 0.04, 0.25], [-0.04, 0.04, 0.25], [-0.04, -0.04, 0.25], [0.04, -0.04, 0.25]])
MIDDLE = CORNERS * [0.25, 0.25, 1.0]


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
