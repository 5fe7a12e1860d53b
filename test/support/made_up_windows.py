# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Windows of made-up pushes, and a model's prediction of one."""

from __future__ import annotations

import numpy as np

from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.windows.push_window import PushWindow

BEGIN = 1_700_000_000_000_000_000


def made_up_windows(count: int, seed: int = 0, per_push: int = 4) -> list[PushWindow]:
    """Windows of pushes that move the slider about as far as the pusher, with scatter."""
    rng = np.random.default_rng(seed)
    return [
        PushWindow(
            push_id=f"push-{k // per_push}",
            index=k % per_push,
            start=BEGIN + k * 200_000_000,
            end=BEGIN + (k + 1) * 200_000_000,
            velocity=float(rng.uniform(0.01, 0.05)),
            contact=float(rng.uniform(0.0, 1.0)),
            angle=float(rng.uniform(-1.0, 1.0)),
            duration=0.2,
            displacement=rng.normal([0.004, 0.0, 0.0], [0.001, 0.001, 0.03]),
            slider_start=rng.normal(size=3),
            slider_end=rng.normal(size=3),
            push_heading=float(rng.uniform(-3.0, 3.0)),
            covariates={"elapsed_time": 0.2 * k, "edge": float(k % 4), **({"normal_force": 1.5} if k % 3 else {})},
        )
        for k in range(count)
    ]


def predict(model: PushModel, window: PushWindow) -> Prediction:
    inputs = np.array([[window.velocity, window.contact, window.angle]])
    return model.predict_rows(inputs, np.array([window.duration]))
