# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The hidden changes of the slider's motion and force: what each does to the conditions of a step."""

from dataclasses import dataclass

import numpy as np

from benchmarks.points_rig.drivers import LASTING, Driver, DriverKind, View
from benchmarks.points_rig.rigs import Rig
from benchmarks.support.plane import Array, cross, direction, rotate

ANY_DRIVER: tuple[DriverKind, ...] = (*LASTING, "topic", "patch", "heading", "edge", "speed")
SPOT_RADIUS, STRIP_HALF_WIDTH, LOST_RADIUS, DENT_PATH = 0.025, 0.015, 0.02, 0.008  # m
ANCHOR = 0.3  # m from the origin to the anchor of the cable


@dataclass(frozen=True)
class Kind:
    """A sort of change: values from small to large, unit, whether a sign is drawn, allowed drivers."""

    values: tuple[float, float, float]
    unit: str
    signed: bool
    drivers: tuple[DriverKind, ...] = ANY_DRIVER
    constant: tuple[str, ...] = ("session", "model_inputs")  # right covariates of a constant effect


_WORLD, _BODY = ("session", "push_heading", "slider_heading"), ("session", "edge", "model_inputs")
_PLACE = ("session", "slider_x", "slider_y")
LIBRARY = {
    "contact_friction": Kind((0.08, 0.15, 0.3), "1", True),
    "pressure_spread": Kind((0.1, 0.2, 0.35), "of its value", True),
    "centre_of_friction": Kind((0.005, 0.01, 0.018), "m", False, constant=_BODY),
    "anisotropic_friction": Kind((0.1, 0.25, 0.5), "1", False, constant=_WORLD),
    "body_anisotropy": Kind((0.1, 0.25, 0.5), "1", False, constant=_BODY),
    "tilted_surface": Kind((0.02, 0.05, 0.1), "of the weight", False, constant=_WORLD),
}
WRENCH = {"surface_friction": Kind((0.1, 0.2, 0.4), "of its value", True, LASTING)}
UNNAMED = {
    "cable": Kind((0.15, 0.35, 0.7), "N", False, constant=_WORLD),
    "twisting_cable": Kind((0.005, 0.012, 0.025), "N m", True),
    "bent_pusher": Kind((0.001, 0.0025, 0.005), "m", True),
    "turning_tip": Kind((0.1, 0.25, 0.6), "of the speed", True),
    "yielding_slider": Kind((0.0007, 0.0015, 0.003), "m", False, LASTING),
    "lost_point": Kind((0.3, 0.6, 0.95), "of its value", False, LASTING, _BODY),
    "sticky_spot": Kind((0.5, 1.0, 2.5), "of its value", False, LASTING, _PLACE),
    "rough_strip": Kind((0.5, 1.0, 2.5), "of its value", False, LASTING, _PLACE),
}
KINDS = LIBRARY | WRENCH | UNNAMED


@dataclass(frozen=True)
class Conditions:
    """What a step's physics depends on; effects change the arrays in place. One row a push; SI units."""

    exponent: Array  # (P, N), log of the change of each point's load; the total load is kept
    roughness: Array  # (P, N), factor of each point's friction by where it stands
    contact_friction: Array  # (P,)
    surface: Array  # (P,), factor of the slider's friction
    world_anisotropy: Array  # (P, 2), xx and xy of the traceless part of W, world axes
    body_anisotropy: Array  # (P, 2), the same in body axes
    pull: Array  # (P, 2), N, world axes
    moment: Array  # (P,), N m about the slider's centre
    offset: Array  # (P,), m along the tangent from the contact to where its force acts
    roll: Array  # (P,), tangential speed of the tip's skin, of the tip's speed
    dent: Array  # (P,), m by which the slider yields


@dataclass(frozen=True)
class Effect:
    """One hidden change: its kind, value at full strength, what it depends on, and a direction of its own, rad."""

    kind: str
    value: float
    driver: Driver
    angle: float

    def apply(self, now: Conditions, view: View, rig: Rig) -> None:
        """Change the conditions of a step."""
        amount, axis = self.value * self.driver.strength(view), direction(self.angle)
        column = amount[:, None]
        match self.kind:
            case "contact_friction":
                now.contact_friction[:] = np.maximum(now.contact_friction + amount, 0.02)
            case "pressure_spread":
                radius = np.linalg.norm(rig.supports - rig.load_centre, axis=1)
                now.exponent[:] += _tilt_for(rig, radius, amount * rig.load_radius)
            case "centre_of_friction":
                now.exponent[:] += _tilt_for(rig, rig.supports @ axis, amount)
            case "anisotropic_friction":
                now.world_anisotropy[:] += column * direction(2 * self.angle)
            case "body_anisotropy":
                now.body_anisotropy[:] += column * direction(2 * self.angle)
            case "tilted_surface":
                now.pull[:] += column * rig.weight * axis
            case "surface_friction":
                now.surface[:] *= 1 + amount
            case "cable":
                hook = rotate(np.array([[0.8 * rig.outline.reach, 0.0]]), view.pose[:, 2] + 2.0 * self.angle)
                line = ANCHOR * axis - view.pose[:, :2] - hook
                force = column * line / np.linalg.norm(line, axis=1, keepdims=True)
                now.pull[:] += force
                now.moment[:] += cross(hook, force)
            case "twisting_cable":
                now.moment[:] += amount
            case "bent_pusher":
                now.offset[:] += amount
            case "turning_tip":
                now.roll[:] += amount
            case "yielding_slider":
                now.dent[:] += amount * (1 - np.exp(-np.maximum(view.path, 0.0) / DENT_PATH))
            case "lost_point":
                near = np.linalg.norm(rig.supports - 0.6 * rig.outline.reach * axis, axis=1) < LOST_RADIUS
                now.exponent[:] += np.log(1 - column) * near
            case "sticky_spot":
                apart = np.linalg.norm(_on_table(view, rig) - 0.04 * axis, axis=2)
                now.roughness[:] *= 1 + column * (apart < SPOT_RADIUS)
            case "rough_strip":
                across = np.abs(_on_table(view, rig) @ axis - 0.02)
                now.roughness[:] *= 1 + column * (across < STRIP_HALF_WIDTH)


def _tilt_for(rig: Rig, feature: Array, shift: Array) -> Array:
    """Exponents k * feature (P, N) of the loads that move the feature's mean by the given shifts (P,)."""
    grid = np.sinh(np.linspace(-4.0, 4.0, 241)) / np.abs(feature).max()
    loads = rig.loads * np.exp(grid[:, None] * (feature - feature.mean()))
    means = loads @ feature / loads.sum(axis=1)
    return np.asarray(np.interp(shift, means - rig.loads @ feature, grid)[:, None] * feature)


def _on_table(view: View, rig: Rig) -> Array:
    """Support points (P, N, 2) in the world, m."""
    return rotate(rig.supports[None], view.pose[:, 2:]) + view.pose[:, None, :2]
