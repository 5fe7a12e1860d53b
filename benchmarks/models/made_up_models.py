# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Small models of a made-up square, plain and extended by effects: what the benchmarks of this room are run on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.predictors import ExtendedPredictor, MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable

DRIFT = DriverBasis("linear", ("elapsed_time",), (500.0,), (300.0,))
NOISE = np.array([[1e-4, 0.0, 0.0], [0.0, 1e-4, 3e-3], [0.0, 0.0, 4e-3]])  # m, m, rad: dy and dtheta are correlated
EIGHT = {
    "contact_friction": 0.25,
    "friction_by_angle": 0.1,
    "centre_x": 0.001,
    "centre_y": -0.001,
    "pushing_height": 0.003,
    "tracker_rotation": 0.02,
    "body_anisotropy": 0.1,
    "radius_error": 0.0002,
}


def made_up_table(count: int, seed: int) -> PushTable:
    """Windows of the square by the analytical model, with constant noise, over 1000 s."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([np.full(count, 0.02), rng.random(count), rng.uniform(-1.0, 1.0, count)])
    duration = np.full(count, 0.2)
    textbook = analytical_mechanics(square_rig().outline, square_rig().pusher_radius)
    outcomes = textbook.displacement(inputs, duration) + rng.normal(size=(count, 3)) * [1e-4, 1e-4, 3e-3]
    covariates = {"elapsed_time": np.linspace(0.0, 1000.0, count), "slider_heading": rng.uniform(-np.pi, np.pi, count)}
    covariates |= {name: rng.uniform(-0.1, 0.1, count) for name in ("slider_x", "slider_y")}
    return PushTable(inputs, duration, outcomes, np.array([f"p{k}" for k in range(count)]), covariates)


def trained_vhgp(count: int) -> PushModel:
    """A VHGP of so many windows at several speeds, with correlated noise that grows with the angle."""
    rng, rig = np.random.default_rng(0), square_rig()
    inputs = rng.uniform([0.01, 0.0, -1.2], [0.05, 1.0, 1.2], (count, 3))
    duration = np.full(count, 0.2)
    outcomes = analytical_mechanics(rig.outline, rig.pusher_radius).displacement(inputs, duration)
    outcomes += rng.normal(size=(count, 3)) @ NOISE * (0.3 + np.abs(inputs[:, 2:]))
    table = PushTable(inputs, duration, outcomes, np.array([f"p{k // 10}" for k in range(count)]))
    return train_model(table, rig, "vhgp", name=f"vhgp_{count}", options=TrainingOptions(mean="zero"))


def square_rig() -> Rig:
    """The MIT square on ABS."""
    return Rig("rect1", shape_outline("rect1"), 0.00475, "abs", 0.837)


def analytical_model(table: PushTable) -> PushModel:
    """The analytical model of these windows."""
    return train_model(table, square_rig(), "analytical", name="analytical")


def eight_fitted() -> FittedMechanics:
    """The square on a patch, with eight parameters that differ from the textbook's."""
    mechanics = PushMechanics(square_rig().outline, square_rig().pusher_radius)
    return FittedMechanics(mechanics, dict(EIGHT), np.zeros((len(EIGHT), len(EIGHT))))


def fitted_model(table: PushTable) -> PushModel:
    """These mechanics with the covariance of the table's noise."""
    base = analytical_model(table)
    assert isinstance(base.predictor, MechanicsPredictor)
    return replace(base, name="fitted", predictor=MechanicsPredictor(eight_fitted(), base.predictor.covariance))


def informed_model(table: PushTable, kind: str) -> PushModel:
    """A learnt model of these windows about the same mechanics."""
    options = TrainingOptions(about=eight_fitted())
    return train_model(table, square_rig(), kind, name="informed", options=options)


def prior_model() -> PushModel:
    """The model before the first push."""
    table = made_up_table(2, 0).take(np.arange(0))
    return train_model(table, square_rig(), "prior", name="prior")


def drifting_effect(mechanism: str | None, *size: float) -> Effect:
    """An effect that grows by `size` in 300 s, known to 10 %."""
    covariance = np.diag(0.1 * np.abs(size)) ** 2
    return Effect(mechanism, "elapsed_time", DRIFT, np.array(size), covariance, np.array([0.02, 0.02, 0.5]))


def extended_model(base: PushModel, *effects: Effect) -> PushModel:
    """The base with these effects."""
    return replace(base, predictor=ExtendedPredictor(base.predictor.base, effects, np.ones(3)))
