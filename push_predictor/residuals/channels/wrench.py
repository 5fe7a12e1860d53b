# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The wrench channel: effects on the force of a push, which need not change its motion.

Quasi-statically the force on the slider lies on the limit surface (f / fmax)^2 + (m / mmax)^2 = 1, whatever the motion.
So the mean force of every window determines fmax, its friction on the surface: L^2 = fn^2 + ft^2 + (moment / c)^2. The
contact friction and the push direction only select a point on the surface. log L is searched for covariates like the
residuals of the motion. A bias of the sensor, constant in the world, also rotates the force, which is compared with the
direction that the model predicts. Nothing here changes the motion model.

Relations that the training windows have too (a place with more friction, a topic that matters) are subtracted. The
window finder zeroes the sensor between pushes, so the force in contact shows a bias only if it occurs there alone. One
that is always there is found from the zero itself (sensor_zero).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.models.effects.covariates import CUMULATIVE, HEADINGS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.channels.contrast import (
    NOTHING_FOUND,
    ChannelEffect,
    ChannelFinding,
    Contrast,
    Stacked,
    best_and_rivals,
    estimate_with_draws,
    inliers,
    is_identifiable,
    robust_deviation,
    screen_contrasts,
    sized,
    stacked,
)
from push_predictor.residuals.channels.sensor_zero import BIAS, WRENCH_BIAS, zero_shift
from push_predictor.residuals.evidence.drivers import (
    CONSTANT,
    LOCAL,
    PLACE,
    SESSION,
    between_ends,
    screening_bases,
    step_places,
)
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.split import FEWEST_PUSHES
from push_predictor.residuals.outcome import Sized, Tested
from push_predictor.types import Array, BoolArray, IntArray

SURFACE_FRICTION = "surface_friction"
SIMPLEST_FIRST = ("linear", "step", "quadratic")  # forms of a change of the friction
MOST_NEAR = 12  # places of a step that are tried near the best of the first
PUSHES_PER_INPUT = 10  # of the controls: all windows of a push share a contact and an angle
PARTS = 2  # of alpha: the zero of the sensor, and the force in contact
OWN = (*LOCAL, "contact", "angle", "edge")  # inputs or outcomes, not causes of surface friction
COMPARED = (*PLACE, *HEADINGS, "velocity")  # tried only against training: friction differs with them on any table
PROGRESS = (*CUMULATIVE, "dwell_time", "time_since_contact", "recording")
FORCES = ("normal_force", "tangential_force")


@dataclass(frozen=True, eq=False)
class _Force:
    """z (n, 2): log load, and direction minus its prediction (rad), each in robust deviations, unit (2,).

    controls (n, m): of the model's inputs. level (n, 1): 1 on new windows, no column without training windows. block
    (n,): of pushes. stack, rows: all windows, and which of them are used.
    """

    z: Array
    unit: Array
    controls: Array
    level: Array
    block: IntArray
    tried: tuple[Contrast, ...]
    stack: Stacked
    rows: BoolArray

    @property
    def table(self) -> PushTable:
        """The new windows."""
        return self.stack.tables[-1]

    @property
    def levelled(self) -> Array:
        """The controls and the level."""
        return np.column_stack([self.controls, self.level])


def wrench_effects(
    table: PushTable, baseline: PushTable | None, mechanics: FittedMechanics, alpha: float = 0.01, seed: int = 0
) -> ChannelFinding:
    """Effects on the force of new windows that differ from the baseline (the model's training windows).

    Half of alpha is for the sensor's zero, where the windows contain it.
    """
    zero = zero_shift(table, baseline)
    if zero is None:
        return _of_contact(table, baseline, mechanics, alpha, seed)
    found = _of_contact(table, baseline, mechanics, alpha / PARTS, seed)
    zero = replace(zero, p_value=_of_channel(zero.p_value))
    since = SESSION if zero.covariate == CONSTANT else zero.covariate
    return ChannelFinding(
        effects=tuple(replace(effect, p_value=_of_channel(effect.p_value)) for effect in found.effects),
        tested=(
            *(replace(tried, p_value=_of_channel(tried.p_value)) for tried in found.tested),
            Tested(WRENCH_BIAS, since, zero.p_value),
        ),
        zero=zero if zero.p_value <= alpha else None,
    )


def _of_channel(p_value: float) -> float:
    """A p value of one part of the channel as one of the whole channel."""
    return min(1.0, PARTS * p_value)


def _of_contact(
    table: PushTable, baseline: PushTable | None, mechanics: FittedMechanics, alpha: float, seed: int
) -> ChannelFinding:
    """Effects on the force while the pusher pushes."""
    if any(name not in table.covariates for name in FORCES):
        return NOTHING_FOUND
    windows, base = _pressing(table), None if baseline is None else _pressing(baseline)
    if len(windows.pushes) < FEWEST_PUSHES:
        return NOTHING_FOUND
    force = _force_of(stacked(windows, base, FORCES), mechanics)
    return _searched(force, alpha, seed)


def _pressing(table: PushTable) -> PushTable:
    """Windows in which the pusher presses against the slider: the others have no load."""
    return table.take(table.covariates["normal_force"] > 0.0) if set(FORCES) <= set(table.covariates) else table


def _force_of(stack: Stacked, mechanics: FittedMechanics) -> _Force:
    each = [loads(table, mechanics) for table in stack.tables]
    z = stack.joined([np.column_stack([load.size, load.direction - load.predicted]) for load in each])
    most = sum(len(table.pushes) for table in stack.tables) // PUSHES_PER_INPUT
    controls = stack.joined([inputs_of(table, mechanics, most) for table in stack.tables])
    unit = np.maximum([robust_deviation(column) for column in Residualizer(controls)(z).T], 1e-12)
    tried = [_of_friction(stack, unit, *pair) for pair in _drivers(stack)]
    tried.append(_of_bias(stack, unit, stack.joined([load.bias for load in each])))
    rows = inliers(z / unit, np.zeros((len(z), 2, 0)), controls)
    kept = tuple(t.take(rows) for t in tried if is_identifiable(t, controls))
    level, block = _level(stack)[rows], stack.block[rows]
    return _Force(z[rows] / unit, unit, controls[rows], level, block, kept, stack, rows)


def _level(stack: Stacked) -> Array:
    """1 on the new windows (n, 1); no column without training windows."""
    return stack.new[:, None].astype(np.float64)[:, : len(stack.tables) - 1]


def _drivers(stack: Stacked) -> list[tuple[str, DriverBasis]]:
    """Covariates of the surface friction; level and place only if there are training windows to compare with."""
    table, before = stack.tables[-1], stack.tables[:-1]
    known = [name for name in COMPARED if all(name in t.covariates for t in before) and before]
    excluded = (*OWN, *(name for name in COMPARED if name not in known))
    kept = {name: column for name, column in table.covariates.items() if name not in excluded}
    bases = screening_bases(replace(table, covariates=kept))
    return [(CONSTANT, DriverBasis("constant")), *bases] if before else bases


def _of_friction(stack: Stacked, unit: Array, covariate: str, basis: DriverBasis) -> Contrast:
    """A change of the load, not of its direction, on the new windows; centred unless it is the level."""
    table = stack.tables[-1]
    values = basis.values(table.covariates, len(table))
    values = values if covariate == CONSTANT else values - values.mean(axis=0)
    columns = np.zeros((len(stack.new), 2, values.shape[1]))
    columns[stack.new, 0] = values / unit[0]
    shared = np.zeros((len(stack.new), 0)) if covariate == CONSTANT else _level(stack)
    if covariate not in (*PROGRESS, CONSTANT) and all(d in t.covariates for t in stack.tables for d in basis.drivers):
        in_both = stack.joined([basis.values(t.covariates, len(t)) for t in stack.tables])
        shared = np.column_stack([shared, in_both]) if len(stack.tables) > 1 else shared
    return Contrast(SURFACE_FRICTION, covariate, basis, columns, shared)


def _of_bias(stack: Stacked, unit: Array, bias: Array) -> Contrast:
    columns = bias / unit[:, None]
    in_both = columns.reshape(len(columns), -1) if len(stack.tables) > 1 else np.zeros((len(columns), 0))
    own = columns * stack.new[:, None, None]
    return Contrast(WRENCH_BIAS, CONSTANT, DriverBasis("constant"), own, np.column_stack([_level(stack), in_both]))


def _searched(force: _Force, alpha: float, seed: int) -> ChannelFinding:
    """Select effects, strongest first; the level of the force counts only if no covariate explains it."""
    z, remaining = force.z, list(force.tried)
    effects: list[ChannelEffect] = []
    tested: tuple[Tested, ...] = ()
    while remaining:
        p_values = screen_contrasts(z, remaining, force.controls, force.block, seed).p_value.tolist()
        tested = tested or tuple(Tested(t.mechanism, t.covariate, p) for t, p in zip(remaining, p_values, strict=True))
        significant = [t for t, p in zip(remaining, p_values, strict=True) if p <= alpha]
        driven = [t for t in significant if not _is_level(t)]
        if not (driven or (significant and not effects)):
            break
        best, alike = _chosen(force, z, driven or significant, seed)
        p_value = p_values[next(k for k, t in enumerate(remaining) if t is best)]
        remaining = [t for t in remaining if t is not best]
        best = _as_step(force, z, best, seed)
        values, draws = estimate_with_draws(z, best.columns, force.controls, best.shared, force.block, seed)
        size, names = _sized(force, best, values, draws), _names(best, alike)
        effects.append(ChannelEffect(best.mechanism, best.covariate, best.basis.name, size, p_value, names))
        z = z - best.columns @ values
    return ChannelFinding(tuple(effects), tested)


def _chosen(force: _Force, z: Array, significant: Sequence[Contrast], seed: int) -> tuple[Contrast, list[Contrast]]:
    """The best contrast in the simplest basis that is not significantly worse, and all rivals."""
    controls = force.controls if _is_level(significant[0]) else force.levelled
    alike = best_and_rivals(z, significant, controls, force.block, seed)
    same = [t for t in alike if (t.mechanism, t.covariate) == (alike[0].mechanism, alike[0].covariate)]
    return min(same, key=lambda t: t.columns.shape[2]), alike


def _as_step(force: _Force, z: Array, best: Contrast, seed: int) -> Contrast:
    """The change of the friction as a step along its covariate, unless a line fits as well or a curve surely better."""
    if best.mechanism != SURFACE_FRICTION or best.basis.name not in ("linear", "quadratic"):
        return best

    def stepped(places: Sequence[float]) -> list[Contrast]:
        bases = [DriverBasis("step", (best.covariate,), place=place) for place in places]
        every = [_of_friction(force.stack, force.unit, best.covariate, basis).take(force.rows) for basis in bases]
        return [each for each in every if is_identifiable(each, force.levelled)]

    values = force.table.covariates[best.covariate]
    fitting = best_and_rivals(z, [best, *stepped(step_places(values))], force.levelled, force.block, seed)
    found = min(fitting, key=lambda t: SIMPLEST_FIRST.index(t.basis.name))
    if found.basis.name != "step":
        return found
    near = stepped(step_places_near(values, found.basis.place))
    return best_and_rivals(z, [found, *near], force.levelled, force.block, seed)[0]


def step_places_near(values: Array, place: float, most: int = MOST_NEAR) -> list[float]:
    """Midpoints between neighbouring values, from the next place that was tried below to the next above."""
    ordered, tried = np.unique(values), step_places(values)
    low = max((other for other in tried if other < place), default=-np.inf)
    high = min((other for other in tried if other > place), default=np.inf)
    middle = 0.5 * (ordered[1:] + ordered[:-1])
    inside = middle[(middle > low) & (middle < high)]
    return [float(middle) for middle in inside[:: max(1, -(-len(inside) // most))]]


def _is_level(tried: Contrast) -> bool:
    return tried.mechanism == SURFACE_FRICTION and tried.covariate == CONSTANT


def _names(best: Contrast, alike: Sequence[Contrast]) -> tuple[str, ...]:
    """Rivals by covariate, or by mechanism where that differs."""
    names = [t.covariate if t.mechanism == SURFACE_FRICTION else WRENCH_BIAS for t in (best, *alike)]
    return tuple(name for name in dict.fromkeys(names[1:]) if name != names[0])


def _sized(force: _Force, best: Contrast, values: Array, draws: Array) -> tuple[Sized, ...]:
    if best.mechanism == WRENCH_BIAS:
        return sized(BIAS, values, draws)
    changes = np.concatenate([values[None], draws]) @ (_over_range(force, best) * force.unit[0]).T
    range_ = changes[:, 0] if changes.shape[1] == 1 else np.subtract(*np.quantile(changes, [0.95, 0.05], axis=1))
    relative = np.expm1(range_)[:, None]
    over = "since training" if best.covariate == CONSTANT else "over the range of its covariate"
    return sized([(f"relative change of the force {over}", "1")], relative[0], relative[1:])


def _over_range(force: _Force, best: Contrast) -> Array:
    """Rows (k, p) of the basis over the new windows, in units of z; one difference where its covariate has ends."""
    if best.covariate == CONSTANT:
        return np.array([[1.0 / force.unit[0]]])
    # A curve may begin and end at the same force.
    change = None if best.basis.name == "quadratic" else between_ends(best.basis, force.table)
    values = best.basis.values(force.table.covariates, len(force.table)) if change is None else change[None]
    return np.asarray(values / force.unit[0])


@dataclass(frozen=True, eq=False)
class Load:
    """Per window: log load on the limit surface, direction (rad, from the inward normal), and predicted direction.

    bias (n, 2, 2): change of load and direction per N of sensor bias in the world.
    """

    size: Array
    direction: Array
    predicted: Array
    bias: Array


def loads(table: PushTable, mechanics: FittedMechanics) -> Load:
    """Load, direction and their sensitivity to a bias, for windows with both forces."""
    normal_force, left_force = (table.covariates[name] for name in FORCES)
    velocity, contact, angle = table.inputs.T
    normal = mechanics.outline.inward_normal(contact)
    left = np.column_stack([-normal[:, 1], normal[:, 0]])
    arm = (mechanics.outline.point(contact) - mechanics.ellipsoid.centre) / mechanics.ellipsoid.length
    p = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    q = arm[:, 0] * left[:, 1] - arm[:, 1] * left[:, 0]
    moment = p * normal_force + q * left_force
    square = normal_force**2 + left_force**2 + moment**2
    along, across = velocity * np.cos(angle), velocity * np.sin(angle)
    direction = _force_direction(p, q, along, across, mechanics.value("contact_friction"))
    by_load = np.column_stack([normal_force + p * moment, left_force + q * moment]) / square[:, None]
    by_turn = np.column_stack([-left_force, normal_force]) / (normal_force**2 + left_force**2)[:, None]
    axes = _world_axes(table, angle)
    bias = -np.stack([np.einsum("nk,nkw->nw", by, axes) for by in (by_load, by_turn)], axis=1)
    return Load(0.5 * np.log(square), np.arctan2(left_force, normal_force), direction, bias)


def _force_direction(p: Array, q: Array, along: Array, across: Array, friction: float) -> Array:
    """Angle (n,) rad of the contact force from the inward normal, on the ellipsoid of Lynch et al. (1992).

    p, q (n,): moment arms over the length of unit forces along the normal and its left; along, across (n,): the
    pusher's velocity in that basis. A contact that sticks moves with the pusher; beyond an edge of the friction cone it
    slips, with the force of that edge.
    """
    push = (1.0 + q * q) * along - p * q * across
    rub = (1.0 + p * p) * across - p * q * along
    edge = np.arctan(friction)
    return np.clip(np.arctan2(rub, push), -edge, edge)


def _world_axes(table: PushTable, angle: Array) -> Array:
    """Inward normal and its left in the world (n, 2, 2), as rows; zero if no heading was recorded."""
    heading = table.covariates.get("push_heading")
    if heading is None:
        return np.zeros((len(table), 2, 2))
    normal = rotate(np.array([[1.0, 0.0]]), heading - angle)
    return np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)


def inputs_of(table: PushTable, mechanics: FittedMechanics, most: int) -> Array:
    """A basis (n, m) of the model's inputs with at most that many columns, for tables of few pushes."""
    velocity, contact, angle = table.inputs.T
    turn = 2.0 * np.pi * contact
    normal = mechanics.outline.inward_normal(contact)
    arm = mechanics.outline.point(contact) / mechanics.ellipsoid.length
    lever = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    columns = [
        np.ones_like(turn),
        lever**2,
        velocity,
        np.cos(turn),
        np.sin(turn),
        angle**2,
        lever * angle,
        angle,
        lever,
    ]
    columns += [np.cos(2.0 * turn), np.sin(2.0 * turn), angle**3, lever * angle**2, lever**2 * angle, lever**3]
    columns += [np.cos(4.0 * turn), np.sin(4.0 * turn)]
    return np.column_stack(columns[:most])
