# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The example that pushes a square through a gate, and the tables of the benchmark of the same planner."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from benchmarks.planning.risk_table import tables
from benchmarks.planning.risk_tasks import TASKS, problem
from examples import plan_around_obstacles
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for


@pytest.mark.long
def test_example_reaches_the_region(capsys, tmp_path):
    recording, path = [plan_around_obstacles.TRAINING], tmp_path / "gp.pushmodel"
    few = TrainingOptions(n_train=200, mean="zero")
    save_model(train_model(load_data(recording), load_rig_for(recording), "gp", name="gp", options=few), path)
    assert plan_around_obstacles.main(["--model", str(path)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"Region reached with [3-9] pushes", said)
    assert all(float(risk) <= 0.1 for risk in re.findall(r"risk of the rest ([\d.]+)", said))


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_problems_are_drawn_by_their_number(task):
    first, again, other = (problem(task, number, shape_outline("rect1")) for number in (3, 3, 4))
    np.testing.assert_array_equal(first.start, again.start)
    assert not np.array_equal(first.start, other.start)
    assert first.scene.clearance(first.start) > 0.004
    assert not first.target.reached(first.start)


def _row(variant, number, result, risk):
    said = [{"risk": risk, "probability": 1.0 - risk, "planned": 2}]
    return {"task": "gate", "variant": variant, "problem": number, "result": result, "pushes": 2, "promised": said}


def test_equal_risk_declines_the_problems_with_the_largest_promised_risk(tmp_path):
    """The informed variant promises more risk where it fails, so that declining costs it no success."""
    rows = []
    for number in range(40):
        failed = number % 10 < 2
        result = "failed" if failed else "reached"
        rows += [
            _row("constant", number, result, 0.1),
            _row("input-dependent, push effects", number, result, 0.3 if failed else 0.01),
        ]
    (tmp_path / "runs.jsonl").write_text("\n".join(map(json.dumps, rows)))
    text = tables(tmp_path / "runs.jsonl")
    assert "40 problems" in text
    strict = text.split("At most 2 %")[1].split("At most 5 %")[0]
    assert re.search(r"\| constant \| 0\.0 .*\| 0\.0 ", strict)
    assert re.search(r"\| input-dependent, push effects \| 80\.0 .*\| 0\.0 .*\| 80\.0 \(", strict)
    assert re.search(r"\| input-dependent, push effects \| 6\.8 \| 20\.0 .*\| 93 \| 80\.0 .*\| 1\.00 \|", text)
