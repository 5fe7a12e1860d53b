# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The wrench channel: effects on the force of a push, which need not change its motion.

Quasi-statically the force on the slider lies on the limit surface (f / fmax)^2 + (m / mmax)^2 = 1, whatever the motion.
So the mean force of every window determines fmax, its friction on the surface: L^2 = fn^2 + ft^2 + (moment / c)^2. The
contact friction and the push direction only select a point on the surface. log L is searched for covariates. Nothing
here changes the motion model.

Relations that the training windows have too (a place with more friction, a topic that matters) are subtracted. The
window finder zeroes the sensor between pushes; a bias is found from the zero itself (sensor_zero).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.effects.covariates import HEADINGS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import (
    NOTHING_FOUND,
    ChannelFinding,
    Quantity,
    along,
    effects_of,
    inliers,
    searched,
    stacked,
)
from push_predictor.residuals.evidence.drivers import CONSTANT, LOCAL, PLACE, screening_bases
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES
from push_predictor.types import Array

SURFACE_FRICTION = "surface_friction"
PUSHES_PER_INPUT = 10  # of the controls: all windows of a push share a contact and an angle
OWN = (*LOCAL, "contact", "angle", "edge")  # inputs or outcomes, not causes of surface friction
COMPARED = (*PLACE, *HEADINGS, "velocity")  # tried only against training: friction differs with them on any table
FORCES = ("normal_force", "tangential_force")


def wrench_effects(
    table: PushTable, baseline: PushTable | None, mechanics: FittedMechanics, alpha: float = 0.01, seed: int = 0
) -> ChannelFinding:
    """Effects on the force of new windows that differ from the baseline (the model's training windows)."""
    if any(name not in table.covariates for name in FORCES):
        return NOTHING_FOUND
    windows, base = _pressing(table), None if baseline is None else _pressing(baseline)
    if len(windows.pushes) < FEWEST_PUSHES:
        return NOTHING_FOUND
    stack = stacked(windows, base, FORCES)
    most = sum(len(each.pushes) for each in stack.tables) // PUSHES_PER_INPUT
    z = np.concatenate([log_load(each, mechanics)[:, None] for each in stack.tables])
    controls = np.concatenate([inputs_of(each, mechanics, most) for each in stack.tables])
    tried = [along(stack, SURFACE_FRICTION, *pair, np.ones(1)) for pair in _drivers(stack.tables)]
    force = Quantity.of(z, controls, stack, tried, inliers(z, np.zeros((len(z), 1, 0)), controls))
    chosen, tested, _ = searched(force, alpha, seed)
    effects = effects_of(chosen, force, windows, "relative change of the force", np.expm1, seed)
    return ChannelFinding(tuple(effects), tested)


def _pressing(table: PushTable) -> PushTable:
    """Windows in which the pusher presses against the slider: the others have no load."""
    return table.take(table.covariates["normal_force"] > 0.0) if set(FORCES) <= set(table.covariates) else table


def _drivers(tables: tuple[PushTable, ...]) -> list[tuple[str, DriverBasis]]:
    """Covariates of the surface friction; level and place only if there are training windows to compare with."""
    *before, table = tables
    known = [name for name in COMPARED if before and name in before[0].covariates]
    excluded = {*OWN, *COMPARED} - {*known}
    kept = {name: column for name, column in table.covariates.items() if name not in excluded}
    bases = screening_bases(replace(table, covariates=kept))
    return [(CONSTANT, DriverBasis("constant")), *bases] if before else bases


def log_load(table: PushTable, mechanics: FittedMechanics) -> Array:
    """Logarithm (n,) of the load on the limit surface, for windows with both forces."""
    normal_force, left_force = (table.covariates[name] for name in FORCES)
    contact = table.inputs[:, 1]
    normal = mechanics.outline.inward_normal(contact)
    arm = (mechanics.outline.point(contact) - mechanics.ellipsoid.centre) / mechanics.ellipsoid.length
    p = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    q = arm[:, 0] * normal[:, 0] + arm[:, 1] * normal[:, 1]
    moment = p * normal_force + q * left_force
    return np.asarray(0.5 * np.log(normal_force**2 + left_force**2 + moment**2))


def inputs_of(table: PushTable, mechanics: FittedMechanics, most: int) -> Array:
    """A basis (n, m) of the model's inputs with at most that many columns, for tables of few pushes."""
    velocity, contact, angle = table.inputs.T
    turn = 2.0 * np.pi * contact
    normal = mechanics.outline.inward_normal(contact)
    arm = mechanics.outline.point(contact) / mechanics.ellipsoid.length
    lever = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    columns = [np.ones_like(turn), lever**2, velocity, np.cos(turn), np.sin(turn)]
    columns += [angle**2, lever * angle, angle, lever]
    columns += [np.cos(2.0 * turn), np.sin(2.0 * turn), angle**3, lever * angle**2, lever**2 * angle, lever**3]
    columns += [np.cos(4.0 * turn), np.sin(4.0 * turn)]
    return np.column_stack(columns[:most])
