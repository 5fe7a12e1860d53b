# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sessions of made-up pushes of a square, models that were trained on one of them, and searches on the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from search_bench import gate_of, search_with

from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.selection.gate import Baseline, baseline_of
from push_predictor.residuals.selection.search import SearchResult

COUNT, WINDOWS = 100, 2  # pushes of a session, as few as have blocks enough (FEWEST_BLOCKS); windows of a push
SIDE = 0.09
SQUARE = Outline(0.5 * SIDE * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]))
RIG = Rig("square", SQUARE, 0.00475, "made up", 0.8)
MECHANICS = analytical_mechanics(SQUARE, 0.00475, 0.25)
NOISE = np.array([0.00007, 0.0001, 0.0028])  # m, m, rad
FOUR = ("contact_friction", "pressure_spread", "centre_of_friction", "anisotropic_friction")
DRIVERS = ("elapsed_time", "topic:/temperature", "slider_x", "slider_heading", "edge")


def pushes(n: int, seed: int, noise: np.ndarray = NOISE) -> PushTable:
    """Pushes of a square with contact friction 0.25; half of the noise is common to the windows of a push."""
    rng = np.random.default_rng(seed)
    push = np.repeat(np.arange(n), WINDOWS)
    edge = rng.integers(4, size=n)[push].astype(np.float64)
    contact = (edge + rng.uniform(0.05, 0.95, n)[push]) / 4.0
    inputs = np.column_stack([np.full(len(push), 0.02), contact, rng.uniform(-1.0, 1.0, n)[push]])
    duration = np.full(len(push), 0.2)
    drawn = np.sqrt(0.5) * (rng.normal(size=(n, 3))[push] + rng.normal(size=(len(push), 3)))
    walk = np.cumsum(rng.normal(size=n))
    covariates = {
        "elapsed_time": 10.0 * push + rng.uniform(0.0, 3.0, n)[push],
        "topic:/temperature": 20.0 + walk[push],
        "slider_x": rng.normal(0.0, 0.03, n)[push],
        "slider_heading": rng.uniform(-np.pi, np.pi, n)[push],
        "edge": edge,
    }
    outcomes = MECHANICS.displacement(inputs, duration) + noise * drawn
    return PushTable(inputs, duration, outcomes, np.array([f"{seed} {k}" for k in push]), covariates)


def seen(model: PushModel, table: PushTable) -> Evidence:
    """The evidence of a table, where effects act on the mechanics that made it."""
    return replace(evidence_of(model, table), mechanics=MECHANICS)


def with_effect(table: PushTable, mechanism: str, basis: DriverBasis, *coefficients: float) -> PushTable:
    """The pushes with an effect on the mechanics that made them, exact for large ones."""
    size = np.array(coefficients)
    effect = Effect(mechanism, "any", basis, size, np.zeros((len(size), len(size))), np.ones(3))
    push = Push.of(table)
    return replace(table, outcomes=table.outcomes + joint_shift(MECHANICS, [effect], push))


def linear(table: PushTable, name: str) -> DriverBasis:
    """Linear in a covariate, about its mean and in units of its standard deviation."""
    values = table.covariates[name]
    return DriverBasis("linear", (name,), (float(values.mean()),), (float(values.std()),))


ANALYTICAL = train_model(pushes(60, 1), RIG, "analytical", name="textbook")
# The mechanics that make the pushes: no effect is a constant error of this model.
EXACT = replace(ANALYTICAL, predictor=MechanicsPredictor(MECHANICS, ANALYTICAL.predictor.covariance))


@cache
def learnt() -> PushModel:
    """A learnt model of pushes without effects."""
    return train_model(pushes(COUNT, 2), RIG, "gp", name="learnt", options=TrainingOptions(mean="zero"))


@cache
def baseline(model: PushModel) -> Baseline:
    """The model's errors on its own training data: the same in every search."""
    return baseline_of(model, MECHANICS)


def searched(
    model: PushModel,
    table: PushTable,
    alpha: float = 0.01,
    mechanisms: Sequence[str] | None = None,
    drivers: Sequence[str] = DRIVERS,
) -> SearchResult:
    """The search on these pushes; mechanisms: that are tried besides the generic polynomial, all if None."""
    gate = gate_of(model, seen(model, table), drivers, alpha, baseline=baseline(model), mechanisms=mechanisms)
    return search_with(model, gate)
