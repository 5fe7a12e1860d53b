# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The specification of a simulated recording, and the physics of its pushes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from push_predictor.recordings.rig import Rig
from push_predictor.simulation.changes import PLAIN, Changes, Topic
from push_predictor.simulation.physics import Physics, PushNoise, knot_count, noise_from_draws
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.sensors import FAULTLESS, Faults, Sensors
from push_predictor.simulation.slider import (
    Slider,
    built_shares,
    pressure_patterns,
    slider_named,
    support_points,
)
from push_predictor.simulation.surface import Surface, friction_field, surface_named
from push_predictor.types import Array

PUSHER_RADIUS = 0.00475  # m
CONTACT_FRICTION = 0.25  # steel on steel, rod against slider
ACCELERATION = 2.5  # m/s^2, of the robot
PLACE_SPREAD, TURN_SPREAD = 0.02, 0.35  # m, rad: standard deviations of the slider's pose before a push


@dataclass(frozen=True, eq=False)
class SimulationSpec:
    """The specification of a simulated recording.

    shape: name of the MIT set, or a Slider. surface: name, or a Surface. seed draws the noise of the pushes and of the
    sensors; surface_seed draws the table and slider_seed the slider, so that recordings can share them.
    contact_friction: mean coefficient. acceleration: of the robot, m/s^2. place_spread (m), turn_spread (rad):
    standard deviations of the slider's pose before a push. changes: effects in addition to the plain rig; faults:
    measurement errors. topics: recorded scalars by name. pauses (n,): waiting time before each push, s; None: none.
    start (n, 3): poses of the slider before each push, NaN where they are drawn; None: all are drawn.
    """

    shape: str | Slider
    surface: str | Surface
    pushes: PushPlan
    seed: int = 0
    surface_seed: int = 0
    slider_seed: int = 0
    name: str = "simulated"
    contact_friction: float = CONTACT_FRICTION
    acceleration: float = ACCELERATION
    place_spread: float = PLACE_SPREAD
    turn_spread: float = TURN_SPREAD
    sensors: Sensors = field(default_factory=Sensors)
    changes: Changes = PLAIN
    faults: Faults = FAULTLESS
    topics: Mapping[str, Topic] = field(default_factory=dict)
    pauses: Array | None = None
    start: Array | None = None

    @property
    def slider(self) -> Slider:
        """The slider. Raises RigError for an unknown name."""
        return slider_named(self.shape) if isinstance(self.shape, str) else self.shape

    @property
    def table(self) -> Surface:
        """The surface. Raises RigError for an unknown name."""
        return surface_named(self.surface) if isinstance(self.surface, str) else self.surface

    def rng(self, purpose: int) -> np.random.Generator:
        """An independent generator for one purpose."""
        return np.random.default_rng([self.seed, purpose])


def simulated_rig(spec: SimulationSpec) -> Rig:
    """The rig of a spec, with nominal values: noise of single pushes is not included."""
    slider = spec.slider
    points = support_points(slider.outline)
    shares = built_shares(points, spec.slider_seed)
    return Rig(
        shape=slider.name,
        outline=slider.outline,
        pusher_radius=PUSHER_RADIUS,
        surface=spec.table.name,
        object_mass=slider.mass,
        support_points=np.asarray(np.round(np.column_stack([points, shares]), 6), dtype=np.float64),
        contact_friction=spec.contact_friction,
        surface_friction=spec.table.friction,
    )


def physics_of(spec: SimulationSpec, length: float) -> Physics:
    """The physics of each push of a spec, for paths up to length (m).

    The table is drawn once; the contact noise is drawn for each push.
    """
    slider, n = spec.slider, len(spec.pushes)
    points = support_points(slider.outline)
    return Physics(
        outline=slider.outline,
        radius=PUSHER_RADIUS,
        mass=np.full(n, slider.mass + spec.changes.added_mass),
        inertia=np.full(n, slider.inertia),
        support=points,
        shares=np.tile(built_shares(points, spec.slider_seed), (n, 1)),
        contact_friction=np.full(n, spec.contact_friction),
        surface=friction_field(spec.table, spec.surface_seed),
        load_noise=_load_noise(spec, points, knot_count(length)),
        contact_noise=_contact_noise(spec, knot_count(length)),
        changes=spec.changes,
    )


def _load_noise(spec: SimulationSpec, points: Array, knots: int) -> PushNoise:
    n, variation = len(spec.pushes), spec.table.pressure_variation
    patterns = variation * pressure_patterns(points, n * (knots + 1), spec.rng(3)).reshape(n, knots + 1, -1)
    return noise_from_draws(patterns)


def _contact_noise(spec: SimulationSpec, knots: int) -> PushNoise:
    draws = spec.table.contact_variation * spec.rng(2).standard_normal((len(spec.pushes), knots + 1, 1))
    return noise_from_draws(draws)


def start_poses(spec: SimulationSpec) -> Array:
    """Poses of the slider before each push: (n, 3) x, y in m, heading in rad."""
    spread = np.array([spec.place_spread, spec.place_spread, spec.turn_spread])
    drawn = np.asarray(spread * spec.rng(1).standard_normal((len(spec.pushes), 3)))
    return drawn if spec.start is None else np.where(np.isnan(spec.start), drawn, spec.start)
