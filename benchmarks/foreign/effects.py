# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Physical changes of the rig that a new recording can hide, each as a change of a push's conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.foreign.conditions import Conditions, State
from benchmarks.foreign.drivers import Driver
from benchmarks.foreign.rig import Rig
from benchmarks.support.plane import Array, cross, direction, rotate, wrapped

ANCHOR_DISTANCE = 0.3  # m from the table's centre to where the cable is tied
SPOT_DISTANCE = 0.03  # m from the slider's centre to a spot on its base
SPOT_WIDTH = 0.012  # m
MAGNET_WIDTH = 0.04  # m
WORN_WIDTH = 0.05  # of the perimeter


@dataclass(frozen=True)
class Effect:
    """One change: `value` in the unit of its kind, along or around `axis`, at `place` (m, world) where it has one.

    `axis` is a direction in rad, or for a worn spot the contact fraction of its centre.
    """

    kind: str
    value: float
    driver: Driver
    axis: float = 0.0
    place: tuple[float, float] = (0.0, 0.0)


Change = Callable[[Conditions, Array, Effect, State, Rig], Conditions]


def changed(conditions: Conditions, effects: Sequence[Effect], state: State, rig: Rig) -> Conditions:
    """Conditions under all `effects`."""
    for effect in effects:
        amount = effect.value * effect.driver.strength(state)
        conditions = CHANGES[effect.kind](conditions, amount, effect, state, rig)
    return conditions


def _contact_friction(conditions: Conditions, amount: Array, _e: Effect, _s: State, _r: Rig) -> Conditions:
    """`amount` is added to the friction coefficient of the tip."""
    return replace(conditions, tip_friction=np.maximum(conditions.tip_friction + amount, 0.02))


def _surface_friction(conditions: Conditions, amount: Array, _e: Effect, _s: State, _r: Rig) -> Conditions:
    """`amount` is the relative change of the table's friction."""
    return replace(conditions, table_friction=conditions.table_friction * (1 + amount))


def _pressure_spread(conditions: Conditions, amount: Array, _e: Effect, _s: State, rig: Rig) -> Conditions:
    """`amount` is the relative change of the load's root-mean-square radius."""
    squared = np.sum(rig.patches**2, axis=1)
    squared = squared / (rig.load @ squared)
    bend = ((1 + amount) ** 2 - 1) / (rig.load @ squared**2 - 1)
    return _reloaded(conditions, bend[:, None] * (squared - 1))


def _centre_of_friction(conditions: Conditions, amount: Array, effect: Effect, _s: State, rig: Rig) -> Conditions:
    """`amount` m is the shift of the load's centre along `axis` in body axes."""
    centred = rig.patches - rig.load @ rig.patches
    covariance = (centred * rig.load[:, None]).T @ centred
    gradient = np.linalg.solve(covariance, direction(np.array(effect.axis)))
    return _reloaded(conditions, amount[:, None] * (centred @ gradient))


def _reloaded(conditions: Conditions, relative: Array) -> Conditions:
    load = conditions.load * np.maximum(1 + relative, 0.02)
    return replace(conditions, load=load / load.sum(axis=1, keepdims=True))


def _anisotropic_friction(conditions: Conditions, amount: Array, effect: Effect, state: State, _r: Rig) -> Conditions:
    """`amount` is the difference between the directions along and across `axis` (world), over their mean."""
    return _stretched(conditions, amount, effect.axis - state.pose[:, 2])


def _body_anisotropy(conditions: Conditions, amount: Array, effect: Effect, _s: State, _r: Rig) -> Conditions:
    """The same with `axis` fixed to the slider."""
    return _stretched(conditions, amount, np.full(len(amount), effect.axis))


def _stretched(conditions: Conditions, amount: Array, axis: Array) -> Conditions:
    turn = _rotation_matrices(axis)
    along = np.stack([1 + amount / 2, 1 - amount / 2], axis=-1)
    return _with_tensor(conditions, (turn * along[:, None, :]) @ turn.transpose(0, 2, 1))


def _skewed_friction(conditions: Conditions, amount: Array, _e: Effect, _s: State, _r: Rig) -> Conditions:
    """Friction is turned by `amount` rad from the direction of sliding, as on a napped cloth."""
    return _with_tensor(conditions, _rotation_matrices(amount))


def _rotation_matrices(angle: Array) -> Array:
    """Rotation matrices (n, 2, 2)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([cosine, -sine], axis=-1), np.stack([sine, cosine], axis=-1)], axis=-2)


def _with_tensor(conditions: Conditions, tensor: Array) -> Conditions:
    return replace(conditions, tensor=tensor if conditions.tensor is None else tensor @ conditions.tensor)


def _tilted_surface(conditions: Conditions, amount: Array, effect: Effect, _s: State, rig: Rig) -> Conditions:
    """Gravity pulls along `axis` (world) with `amount` of the weight."""
    pull = (amount * rig.weight)[:, None] * direction(np.array(effect.axis))
    return replace(conditions, force=conditions.force + pull)


def _cable(conditions: Conditions, amount: Array, effect: Effect, state: State, _r: Rig) -> Conditions:
    """A cable at the slider's rim pulls with `amount` N towards a far anchor, and so also turns the slider."""
    arm = rotate(SPOT_DISTANCE * direction(np.full(len(amount), effect.axis + 1.0)), state.pose[:, 2])
    towards = ANCHOR_DISTANCE * direction(np.array(effect.axis)) - state.pose[:, :2] - arm
    pull = (amount / np.linalg.norm(towards, axis=1))[:, None] * towards
    return replace(conditions, force=conditions.force + pull, torque=conditions.torque + cross(arm, pull))


def _magnet(conditions: Conditions, amount: Array, effect: Effect, state: State, _r: Rig) -> Conditions:
    """A magnet under the table at `place` attracts the slider's centre with at most `amount` N."""
    apart = (np.array(effect.place) - state.pose[:, :2]) / MAGNET_WIDTH
    pull = (amount * np.exp(0.5 - 0.5 * np.sum(apart**2, axis=1)))[:, None] * apart
    return replace(conditions, force=conditions.force + pull)


def _rubber_band(conditions: Conditions, amount: Array, effect: Effect, state: State, _r: Rig) -> Conditions:
    """A twisted band turns the slider towards heading `axis` with at most `amount` N m."""
    return replace(conditions, torque=conditions.torque - amount * np.sin(state.pose[:, 2] - effect.axis))


def _soft_tip(conditions: Conditions, amount: Array, _e: Effect, _s: State, _r: Rig) -> Conditions:
    """The tip's mounting becomes more compliant by `amount` m/N."""
    return replace(conditions, stiffness=1 / (1 / conditions.stiffness + amount))


def _worn_edge(conditions: Conditions, amount: Array, effect: Effect, state: State, _r: Rig) -> Conditions:
    """A dent around contact `axis` leans the outline's normal by up to `amount` rad."""
    apart = wrapped(2 * np.pi * (state.contact - effect.axis)) / (2 * np.pi)
    return replace(conditions, normal_tilt=conditions.normal_tilt + amount * np.exp(-0.5 * (apart / WORN_WIDTH) ** 2))


def _sticky_base(conditions: Conditions, amount: Array, effect: Effect, state: State, rig: Rig) -> Conditions:
    """A spot of the base sticks at rest: extra friction of `amount` of the sliding friction that fades over 6 mm."""
    return _spotted(conditions, amount * np.exp(-state.travelled / 0.006), effect, rig)


def _grease(conditions: Conditions, amount: Array, effect: Effect, state: State, rig: Rig) -> Conditions:
    """Thick grease at a spot of the base: extra friction of `amount` at 20 mm/s, in proportion to the push's speed."""
    return _spotted(conditions, amount * state.facts.speed / 0.02, effect, rig)


def _spotted(conditions: Conditions, amount: Array, effect: Effect, rig: Rig) -> Conditions:
    apart = rig.patches - SPOT_DISTANCE * direction(np.array(effect.axis))
    spot = np.exp(-0.5 * np.sum(apart**2, axis=1) / SPOT_WIDTH**2)
    return replace(conditions, load=conditions.load + amount[:, None] * spot / spot.sum())


CHANGES: dict[str, Change] = {
    "contact_friction": _contact_friction,
    "surface_friction": _surface_friction,
    "pressure_spread": _pressure_spread,
    "centre_of_friction": _centre_of_friction,
    "anisotropic_friction": _anisotropic_friction,
    "body_anisotropy": _body_anisotropy,
    "tilted_surface": _tilted_surface,
    "cable": _cable,
    "magnet": _magnet,
    "rubber_band": _rubber_band,
    "skewed_friction": _skewed_friction,
    "soft_tip": _soft_tip,
    "worn_edge": _worn_edge,
    "sticky_base": _sticky_base,
    "grease": _grease,
}
