# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models with effects that drift, and pushes whose truth has the same effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from synthetic import square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import PushTable

NOISE = np.array([1e-4, 1e-4, 3e-3])
DRIFT = DriverBasis("linear", ("elapsed_time",), (500.0,), (300.0,))
GRAIN = ("anisotropic_friction", "push_heading", DriverBasis("constant"))


def mechanics() -> FittedMechanics:
    rig = square_rig()
    return analytical_mechanics(rig.outline, rig.pusher_radius)


def pushes(count: int = 100, seed: int = 0, *effects: Effect) -> PushTable:
    """Pushes of three windows, by the analytical model with these effects; the windows of a push share some noise."""
    rng = np.random.default_rng(seed)
    n = 3 * count
    inputs = np.column_stack([np.full(n, 0.02), rng.random(n), rng.uniform(-0.9, 0.9, n)])
    duration = np.full(n, 0.2)
    shared = np.repeat(rng.standard_normal((count, 3)), 3, axis=0)
    outcomes = mechanics().displacement(inputs, duration) + NOISE * (0.5 * shared + rng.standard_normal((n, 3)))
    covariates = {
        "elapsed_time": np.repeat(np.linspace(0.0, 1000.0, count), 3),
        "topic:/warmth": np.repeat(rng.standard_normal(count), 3),
        "slider_heading": rng.uniform(-np.pi, np.pi, n),
    }
    shift = joint_shift(mechanics(), effects, Push(inputs, duration, covariates))
    push_id = np.array([f"{seed}-{k // 3}" for k in range(n)])
    return PushTable(inputs, duration, outcomes + shift, push_id, covariates)


def slippery(size: float, sd: float = 0.0) -> Effect:
    """A contact friction that changes by `size` in 300 s."""
    return Effect("contact_friction", "elapsed_time", DRIFT, np.array([size]), np.array([[sd**2]]), np.ones(3))


def grain(size: float) -> Effect:
    return Effect(*GRAIN, np.array([size, 0.5 * size]), np.diag([1e-4, 1e-4]), np.ones(3))


def extended(base: PushModel, *effects: Effect, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> PushModel:
    return replace(base, predictor=ExtendedPredictor(base.predictor.base, effects, np.array(scale)))
