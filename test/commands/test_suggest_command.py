# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`push_predictor suggest`: the table that it writes, its options, and what it refuses."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import noisy_pushes, square_rig

from push_predictor.cli import main
from push_predictor.commands.suggest_command import COLUMNS
from push_predictor.design.batch import Suggested, suggest_pushes
from push_predictor.design.limits import Limits
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import save_rig
from push_predictor.recordings.table_file import write_table
from push_predictor.types import Array

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few candidates: the command does not depend on their number."""
    monkeypatch.setattr("push_predictor.design.batch.CANDIDATES", 32)
    monkeypatch.setattr("push_predictor.design.batch.MATTER", 16)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model file, a rig file, and a table of pushes that matter."""
    folder = tmp_path_factory.mktemp("suggest")
    table = noisy_pushes(60)
    train_model(table, square_rig(), "gp", name="square", options=TrainingOptions(mean="zero")).save(
        folder / "gp.pushmodel"
    )
    save_rig(square_rig(), folder / "rig.yaml")
    write_table(folder / "steep.csv", table.take(table.inputs[:, 2] > 0.6))
    return folder


def written(path: Path) -> dict[str, Array]:
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert tuple(rows[0]) == COLUMNS
    return {name: np.array([float(row[name]) for row in rows]) for name in COLUMNS}


def test_writes_the_suggested_pushes_in_order(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "new" / "pushes.csv"
    assert main(["suggest", str(folder / "gp.pushmodel"), "--count", "4", "--out", str(out), "--seed", "3"]) == 0
    expected = suggest_pushes(load_model(folder / "gp.pushmodel"), 4, seed=3)
    found = written(out)
    np.testing.assert_allclose(np.column_stack([found[n] for n in COLUMNS[:3]]), expected.inputs, rtol=1e-5)
    np.testing.assert_allclose(found["duration"], 0.03 / found["velocity"], rtol=1e-5)
    np.testing.assert_allclose(found["variance_left"], expected.variance_left, rtol=1e-5)
    printed = capsys.readouterr().out
    assert "4 pushes for square" in printed
    assert f"leave {100.0 * expected.variance_left[-1]:.0f} % of the variance" in printed


def test_keeps_to_the_limits_without_a_model(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[PushModel, int, Limits, Suggested]] = []

    def noted(model: PushModel, count: int, limits: Limits, **options: Any) -> Suggested:
        calls.append((model, count, limits, suggest_pushes(model, count, limits, **options)))
        return calls[-1][-1]

    monkeypatch.setattr("push_predictor.design.batch.suggest_pushes", noted)
    limits = ["--speed-range", "0.03", "0.05", "--angle-range", "-0.2", "0.4"]
    limits += ["--travel", "0.02", "--exclude", "0.5", "1.0"]
    call = ["suggest", "--rig", str(folder / "rig.yaml"), "--count", "3", "--transfer-speed", "0.1", *limits]
    assert main([*call, "--out", str(folder / "first.csv"), "--json", "-"]) == 0
    found, shown = written(folder / "first.csv"), json.loads(capsys.readouterr().out)
    assert shown["model"] == "rig" and len(shown["pushes"]) == 3
    for name in COLUMNS:
        np.testing.assert_allclose([push[name] for push in shown["pushes"]], found[name], rtol=1e-5)
    ((model, count, limits_given, same),) = calls
    assert (model.kind, len(model.training), count) == ("prior", 0, 3)
    assert model.rig.to_record() == square_rig().to_record()
    assert limits_given == Limits((0.03, 0.05), (-0.2, 0.4), 0.02, ((0.5, 1.0),), 0.1)
    assert np.all((found["velocity"] >= 0.03) & (found["velocity"] <= 0.05) & (found["contact"] < 0.5))
    assert np.all((found["angle"] >= -0.2) & (found["angle"] <= 0.4))
    np.testing.assert_allclose(np.column_stack([found[n] for n in COLUMNS[:3]]), same.inputs, rtol=1e-5)
    np.testing.assert_allclose(found["duration"] * found["velocity"], 0.02, rtol=1e-5)


def test_the_pushes_that_matter_may_be_given(folder: Path) -> None:
    out = folder / "steep_pushes.csv"
    matter = ["--matter", str(folder / "steep.csv")]
    assert main(["suggest", str(folder / "gp.pushmodel"), "--count", "3", *matter, "--out", str(out)]) == 0
    assert np.all(written(out)["angle"] > 0.2)
