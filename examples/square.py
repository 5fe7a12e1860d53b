# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The square of examples/mpc.py: a model with windows of 0.1 s, for a loop at 10 Hz; the rig; an obstacle."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.unscented import PusherGeometry
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.simulation.pushes import grid_pushes
from push_predictor.simulation.slider import slider_named
from push_predictor.simulation.spec import SimulationSpec

TRAINING = Path(__file__).resolve().parents[1] / "bags" / "square_abs_train"
WINDOW = 0.1  # s
TABLE = np.array([[-0.25, -0.25], [0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]])  # m
OBSTACLE = np.array([[-0.04, 0.03], [-0.02, 0.03], [-0.02, 0.1], [-0.04, 0.1]])
SCENE = Scene(slider_named("rect1").outline, TABLE, [OBSTACLE])


def square_model(path: Path | str) -> PushModel:
    """The model of a file; if there is none, it is trained in a few seconds and saved."""
    path = Path(path)
    if not path.exists():
        rig = load_rig_for([TRAINING])
        table = load_data([TRAINING], rig, WindowOptions(duration=WINDOW))
        options = TrainingOptions(n_train=1000, mean="mechanics")
        path.parent.mkdir(parents=True, exist_ok=True)
        save_model(train_model(table, rig, "vhgp", name="square", options=options), path)
    return load_model(path)


def square_spec(seed: int) -> SimulationSpec:
    """The rig of the training recording; seed: of the noise."""
    return SimulationSpec("rect1", "abs", grid_pushes([0.125], [0.0], 1), seed=seed)


def square_pusher(model: PushModel) -> PusherGeometry:
    """Outline, tip and window of a model."""
    return PusherGeometry(model.rig.outline, model.rig.pusher_radius, model.usual_duration)
