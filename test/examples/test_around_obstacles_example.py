# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The example that pushes a square through a gate, and the benchmark of the same planner."""

from __future__ import annotations

import re

import numpy as np
import pytest

from benchmarks.planning.risk import TASKS, accepted, problem
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
    np.testing.assert_array_equal(first.slider, again.slider)
    assert not np.array_equal(first.slider, other.slider)
    assert first.scene.clearance(first.slider) > 0.004
    assert not first.target.reached(first.slider)


def test_equal_risk_declines_the_problems_with_the_largest_promised_risk():
    """Where more risk is promised to the runs that fail, declining them costs no success; else it costs all."""
    failed = np.arange(40) % 10 < 2
    np.testing.assert_array_equal(accepted(np.where(failed, 0.3, 0.01), failed), ~failed)
    assert not accepted(np.full(40, 0.1), failed).any()


def test_the_threshold_of_a_half_comes_from_the_other():
    """The even problems alone fail: none of the odd ones is accepted, and all of the even ones."""
    even = np.arange(40) % 2 == 0
    np.testing.assert_array_equal(accepted(np.full(40, 0.1), even), even)
