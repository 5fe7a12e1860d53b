# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig: everything that stays the same between the training and the new recording."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.outlines import OUTLINES, Outline, patch_grid
from benchmarks.support.plane import Array

PUSHER_RADIUS = 0.00475  # m
GRAVITY = 9.81  # m/s^2
SURFACES = {"plywood": 0.28, "delrin": 0.17, "pu": 0.36, "abs": 0.16}  # surface: friction of the slider on it
SHAPES = {"rect1": 0.70, "ellip2": 0.08, "ellip3": 0.08, "hex": 0.14}  # shape: share of the recordings


@dataclass(frozen=True)
class TableFriction:
    """Friction between slider and table at sliding speed v (m/s), before any change.

    mu(v) = coefficient (1 + rise / (1 + (v / fade)^2) + slope v), and within `creep` m/s of rest friction is viscous.
    `waves` are the table's uneven places: rows (amplitude, wave number x, wave number y in rad/m, phase).
    """

    coefficient: float
    rise: float
    fade: float
    slope: float
    creep: float
    waves: Array

    def unevenness(self, place: Array) -> Array:
        """Friction at `place`, shape (n, 2) m, relative to its mean."""
        phases = place @ self.waves[:, 1:3].T + self.waves[:, 3]
        return np.asarray(1.0 + np.sin(phases) @ self.waves[:, 0])


@dataclass(frozen=True)
class NoiseLevels:
    """Process noise: standard deviations of random changes between and within pushes, all relative.

    `tilt` moves the load's centre, `texture` its finer distribution, `tip_friction` is the friction of the tip,
    `table_friction` the friction of the table. `length` is the travel over which they decorrelate, m; `lasting` is the
    share of the variance that stays for a whole push.
    """

    tilt: float
    texture: float
    tip_friction: float
    table_friction: float
    length: float
    lasting: float


@dataclass(frozen=True)
class Sensors:
    """What the sensors add: rates in Hz, times in s, standard deviations in m, rad, N."""

    tracker_rate: float
    tracker_latency: float
    tracker_noise: float
    heading_noise: float
    wander: float
    heading_wander: float
    wander_time: float
    pusher_rate: float
    pusher_noise: float
    wrench_rate: float
    wrench_noise: float
    torque_noise: float
    wrench_axes: Array


@dataclass(frozen=True)
class Rig:
    """One rig.

    `load` holds the share of the weight that each patch of the base carries. `stiffness` (N/m) and `tip_damping`
    (s, damping over stiffness) belong to the tip's mounting.
    """

    shape: str
    surface: str
    mass: float
    inertia: float
    patches: Array
    load: Array
    table: TableFriction
    contact_friction: float
    stiffness: float
    tip_damping: float
    noise_levels: NoiseLevels
    sensors: Sensors
    retreat: str
    consecutive_share: float
    humidity: bool
    warmth: float

    @property
    def outline(self) -> Outline:
        """The slider's outline."""
        return OUTLINES[self.shape]

    @property
    def weight(self) -> float:
        """The slider's weight, N."""
        return self.mass * GRAVITY

    def record(self) -> dict[str, str]:
        """The `push_rig` record of a recording of this rig."""
        facts = {
            "shape": self.shape,
            "outline": json.dumps(self.outline.vertices.tolist()),
            "pusher_radius": json.dumps(PUSHER_RADIUS),
            "surface": self.surface,
            "object_mass": json.dumps(round(self.mass, 4)),
        }
        if self.outline.parameters is not None:
            facts["shape_parameters"] = json.dumps(self.outline.parameters)
        return facts


def draw_rig(rng: np.random.Generator, shape: str | None = None) -> Rig:
    """Draw a rig; `shape` fixes the slider's shape."""
    shape = shape or str(rng.choice(list(SHAPES), p=list(SHAPES.values())))
    patches = patch_grid(OUTLINES[shape])
    surface = str(rng.choice(list(SURFACES)))
    mass = float(rng.uniform(0.8, 1.2))
    return Rig(
        shape=shape,
        surface=surface,
        mass=mass,
        inertia=mass * float(np.mean(np.sum(patches**2, axis=1))),
        patches=patches,
        load=_warped_load(rng, patches),
        table=_draw_table(rng, SURFACES[surface]),
        contact_friction=float(rng.uniform(0.15, 0.4)),
        stiffness=float(rng.uniform(4000, 9000)),
        tip_damping=float(rng.uniform(0.006, 0.012)),
        noise_levels=_draw_noise_levels(rng),
        sensors=_draw_sensors(rng),
        retreat=str(rng.choice(["lift", "lift", "drive_back"])),
        consecutive_share=float(rng.choice([0.0, 0.0, 0.25])),
        humidity=bool(rng.random() < 0.5),
        warmth=float(rng.uniform(18, 26)),
    )


def _warped_load(rng: np.random.Generator, patches: Array) -> Array:
    """Load shares of a warped base: a few smooth random modes in body coordinates."""
    radius = np.sqrt(np.mean(np.sum(patches**2, axis=1)))
    scaled = patches / radius
    tilt = scaled @ rng.normal(0, 0.08, 2)
    bowl = rng.normal(0, 0.2) * (np.sum(scaled**2, axis=1) - 1)
    saddle = rng.normal(0, 0.15) * (scaled[:, 0] ** 2 - scaled[:, 1] ** 2) + rng.normal(0, 0.15) * np.prod(
        scaled, axis=1
    )
    waves = sum(
        rng.normal(0, 0.2) * np.sin(patches @ rng.normal(0, 2 * np.pi / 0.08, 2) + rng.uniform(0, 2 * np.pi))
        for _ in range(3)
    )
    load = np.exp(tilt + bowl + saddle + waves)
    return np.asarray(load / load.sum())


def _draw_table(rng: np.random.Generator, friction: float) -> TableFriction:
    waves = np.column_stack(
        [rng.normal(0, 0.012, 4), rng.normal(0, 2 * np.pi / 0.2, (4, 2)), rng.uniform(0, 2 * np.pi, 4)]
    )
    return TableFriction(
        coefficient=friction * float(rng.uniform(0.85, 1.15)),
        rise=float(rng.uniform(0.0, 0.08)),
        fade=float(rng.uniform(0.003, 0.015)),
        slope=float(rng.uniform(0.0, 0.6)),
        creep=0.00015,
        waves=waves,
    )


def _draw_noise_levels(rng: np.random.Generator) -> NoiseLevels:
    size = float(rng.uniform(0.8, 1.2))
    return NoiseLevels(
        tilt=0.1 * size,
        texture=0.25 * size,
        tip_friction=0.15 * size,
        table_friction=0.04 * size,
        length=float(rng.uniform(0.004, 0.012)),
        lasting=float(rng.uniform(0.15, 0.35)),
    )


def _draw_sensors(rng: np.random.Generator) -> Sensors:
    roll, pitch, yaw = rng.normal(0, 0.02, 3)
    tilt = np.array([[1.0, -yaw, pitch], [yaw, 1.0, -roll], [-pitch, roll, 1.0]])
    axes = np.linalg.qr(tilt)[0]
    return Sensors(
        tracker_rate=float(rng.choice([100.0, 120.0, 150.0, 200.0, 250.0])),
        tracker_latency=float(rng.uniform(0.001, 0.008)),
        tracker_noise=0.00007,
        heading_noise=0.0001,
        wander=0.00006,
        heading_wander=0.0001,
        wander_time=float(rng.uniform(10, 60)),
        pusher_rate=250.0,
        pusher_noise=0.00002,
        wrench_rate=float(rng.choice([125.0, 250.0])),
        wrench_noise=0.1,
        torque_noise=0.002,
        wrench_axes=np.asarray(axes * np.sign(np.diag(axes))),
    )
