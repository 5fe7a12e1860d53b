"""What is simulated: slider, table, pushes, seeds; and the physics that follows from them, push by push."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from push_predictor.recordings.rig import Rig
from push_predictor.simulation.changes import PLAIN, Changes, Topic
from push_predictor.simulation.noise import Scatter, knots_for, mixed
from push_predictor.simulation.physics import Physics
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
PLACE_SPREAD, TURN_SPREAD = 0.02, 0.35  # m, rad: how exactly the slider is put back


@dataclass(frozen=True, eq=False)
class SimulationSpec:
    """A recording to be made.

    shape: name of the MIT set, or a Slider. surface: name, or a Surface. seed draws what differs from push to push
    and the sensors' noise; surface_seed draws the table, slider_seed the slider as it was made: recordings can share
    them.
    contact_friction: mean coefficient. acceleration: the robot's, m/s^2. place_spread (m), turn_spread (rad):
    standard deviations of where the slider is put before a push.
    changes: what acts beside the plain rig; faults: of the measurement. topics: scalars recorded beside the pushes, by
    name; pauses (n,): s that the rig waits before each push, none if None.
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

    @property
    def slider(self) -> Slider:
        """The slider itself. Raises RigError for a name that is not known."""
        return slider_named(self.shape) if isinstance(self.shape, str) else self.shape

    @property
    def table(self) -> Surface:
        """The surface itself. Raises RigError for a name that is not known."""
        return surface_named(self.surface) if isinstance(self.surface, str) else self.surface

    def rng(self, purpose: int) -> np.random.Generator:
        """An independent generator for one purpose."""
        return np.random.default_rng([self.seed, purpose])


def simulated_rig(spec: SimulationSpec) -> Rig:
    """The push_rig record of a spec: nominal values, not what single pushes drew."""
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
    """What each push of a spec meets over ways up to length (m): the table drawn once, the contacts push by push."""
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
        pressure=_pressure(spec, points, knots_for(length)),
        rubbing=_rubbing(spec, knots_for(length)),
        changes=spec.changes,
    )


def _pressure(spec: SimulationSpec, points: Array, knots: int) -> Scatter:
    n, variation = len(spec.pushes), spec.table.pressure_variation
    patterns = variation * pressure_patterns(points, n * (knots + 1), spec.rng(3)).reshape(n, knots + 1, -1)
    return mixed(patterns)


def _rubbing(spec: SimulationSpec, knots: int) -> Scatter:
    draws = spec.table.contact_variation * spec.rng(2).standard_normal((len(spec.pushes), knots + 1, 1))
    return mixed(draws)


def start_poses(spec: SimulationSpec) -> Array:
    """Where the slider is put before each push: (n, 3) x, y in m, heading in rad."""
    spread = np.array([spec.place_spread, spec.place_spread, spec.turn_spread])
    return np.asarray(spread * spec.rng(1).standard_normal((len(spec.pushes), 3)))
