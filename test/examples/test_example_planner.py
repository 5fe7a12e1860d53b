# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The example planner end to end over DDS, and the simulated rig on which it pushes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import ros_harness as harness

from examples import plan_pushes, processes
from push_predictor.geometry.frames import wrap_angle
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.simulation.interactive_rig import push_once
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec

SLIDERS = np.array([[0.02, -0.03, 0.4], [-0.05, 0.06, -2.0]])


def pushes(contact, angle, travel, seed=3) -> SimulationSpec:
    count = len(contact)
    plan = PushPlan(np.array(contact), np.array(angle), np.full(count, 0.02), np.array(travel))
    return SimulationSpec("rect1", "abs", plan, seed=seed)


def test_a_push_moves_the_slider_that_it_meets():
    """Onto the middle of a side, along its normal: the slider goes as far as the tip and turns little."""
    after = push_once(pushes([0.125, 0.375], [0.0, 0.0], [0.008, 0.008]), SLIDERS)
    ahead = SLIDERS[:, 2] + [0.0, np.pi / 2.0]
    moved = after[:, :2] - SLIDERS[:, :2]
    np.testing.assert_allclose(
        np.sum(moved * np.column_stack([np.cos(ahead), np.sin(ahead)]), axis=1), 0.008, atol=3e-4
    )
    assert np.abs(wrap_angle(after[:, 2] - SLIDERS[:, 2])).max() < 0.2


def test_the_noise_of_a_push_depends_on_the_seed_and_not_on_the_other_pushes():
    first = push_once(pushes([0.1, 0.4], [0.3, 0.1], [0.008, 0.004]), SLIDERS)
    second = push_once(pushes([0.1, 0.9], [0.3, -0.5], [0.008, 0.030]), SLIDERS)
    np.testing.assert_allclose(second[0], first[0], atol=1e-5)
    other = push_once(pushes([0.1, 0.4], [0.3, 0.1], [0.008, 0.004], seed=4), SLIDERS)
    assert np.abs(other[0] - first[0]).max() > 1e-4


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("planner") / "gp.pushmodel"
    recording = [plan_pushes.TRAINING]
    save_model(
        train_model(
            load_data(recording),
            load_rig_for(recording),
            "gp",
            name="gp",
            options=TrainingOptions(n_train=200, mean="zero"),
        ),
        path,
    )
    return path


@pytest.mark.long
def test_the_example_reaches_its_goal(model, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(harness.free_domain()))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setattr(plan_pushes, "OUT", tmp_path)
    monkeypatch.setattr(plan_pushes, "LOGS", tmp_path)
    monkeypatch.setattr(processes, "LOGS", tmp_path)
    assert plan_pushes.main(["--model", str(model)]) == 0
    output = capsys.readouterr().out
    assert re.search(r"Goal reached with \d+ pushes", output) and "NOT" not in output
    sure = re.findall(r"with probability (\d\.\d\d) \(by rollout_pushes: (\d\.\d\d)\)", output)
    assert sure and all(abs(float(ours) - float(theirs)) < 0.2 for ours, theirs in sure)
    assert (tmp_path / "pushes.png").stat().st_size > 10_000
