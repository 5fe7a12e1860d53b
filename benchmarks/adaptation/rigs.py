# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings of one rig on two days, of three simulators: on the second day one property of the rig has changed.

Monday's recording is of the plain rig. Tuesday's differ in one property each, from their first push on; with `wear`
the contact friction rises in proportion to the distance slid. Signs and directions are drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.blind.effects import IN_LIBRARY, World
from benchmarks.blind.recordings import conditions, later_spec, rig_of
from benchmarks.foreign import drivers as foreign_drivers
from benchmarks.foreign import effects as foreign_effects
from benchmarks.foreign import engine
from benchmarks.foreign.change import Change
from benchmarks.foreign.plan import PushDistribution
from benchmarks.foreign.recording import DAY, FIRST_DAY, draw_inputs, write_session
from benchmarks.foreign.rig import draw_rig as draw_foreign_rig
from benchmarks.points_rig import drivers as points_drivers
from benchmarks.points_rig import effects as points_effects
from benchmarks.points_rig.pairs import EPOCH, record
from benchmarks.points_rig.rigs import draw_rig as draw_points_rig
from benchmarks.points_rig.scenarios import Scenario
from benchmarks.points_rig.sessions import plan_session
from benchmarks.support.bags import write_bag
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.changes import Moment
from push_predictor.simulation.physics import GRAVITY
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.types import Array

MONDAY, NOTHING, WEAR = "before", "nothing", "wear"
MONDAY_PUSHES, TUESDAY_PUSHES = 250, 140
KINDS = {  # by change, the simulators' name of what acts
    "contact_friction": "contact_friction",
    "pressure": "pressure_spread",
    "anisotropy": "anisotropic_friction",
    WEAR: "contact_friction",
    "tilt": "tilted_surface",
    NOTHING: "",
}
CHANGES = tuple(KINDS)
# Sizes in the units of the simulators' catalogues, medium to large there.
SIZES = {
    "own": {"contact_friction": 0.25, "pressure": 1.5, "anisotropy": 0.3, WEAR: 0.5, "tilt": 0.04},
    "points": {"contact_friction": 0.2, "pressure": 0.25, "anisotropy": 0.35, WEAR: 0.4, "tilt": 0.06},
    "foreign": {"contact_friction": 0.25, "pressure": 0.15, "anisotropy": 0.5, WEAR: 0.45, "tilt": 0.06},
}
SIGNED = {"own": ("pressure",), "points": ("contact_friction", "pressure"), "foreign": ("contact_friction", "pressure")}
LEAST_FRICTION = 0.05  # of the contact after a change


@dataclass(frozen=True)
class Session:
    """One recording of a rig: which simulator's, seed, one of CHANGES or MONDAY."""

    rig: str
    seed: int
    name: str

    @property
    def pushes(self) -> int:
        """Number of pushes."""
        return MONDAY_PUSHES if self.name == MONDAY else TUESDAY_PUSHES

    @property
    def day(self) -> int:
        """Number of the day, 0 on Monday: every recording has its own, so that no stamps coincide."""
        return 0 if self.name == MONDAY else 1 + CHANGES.index(self.name)

    @property
    def rng(self) -> np.random.Generator:
        """The generator of what is pushed, measured and changed."""
        return np.random.default_rng([self.seed, 1 + self.day])

    def value(self, rng: np.random.Generator, friction: float = np.inf) -> float:
        """Size of the change; never a contact friction below LEAST_FRICTION."""
        size = SIZES[self.rig][self.name]
        negative = self.name in SIGNED[self.rig] and rng.random() < 0.5
        return -size if negative and (self.name != "contact_friction" or friction - size > LEAST_FRICTION) else size


def write_session_of(folder: Path, session: Session) -> None:
    """Write the bag of a recording into a new folder."""
    RIGS[session.rig](folder, session)


def _own(folder: Path, session: Session) -> None:
    spec = rig_of(np.random.default_rng([session.seed, 0]), "before", MONDAY_PUSHES)
    if session.name != MONDAY:
        rng = session.rng
        spec = later_spec(spec, rng, session.pushes)
        if session.name != NOTHING:
            known = conditions(spec)
            world = World(spec.slider.outline, spec.slider.mass * GRAVITY, spec.table.friction, known, rng)
            (kind,) = (kind for kind in IN_LIBRARY if kind.name == KINDS[session.name])
            furthest = float(known.values["slid_distance"].max())

            def strength(moment: Moment) -> Array:
                slid = moment.conditions.values["slid_distance"]
                return slid / furthest if session.name == WEAR else np.ones(len(slid))

            spec = replace(spec, changes=kind.acts(session.value(rng), strength, world))
    write_recording(folder, simulate(spec))


def _points(folder: Path, session: Session) -> None:
    rig, rng = draw_points_rig(np.random.default_rng([session.seed, 0])), session.rng
    planned, effects = plan_session(rng, rig, session.pushes), ()
    if session.name not in (MONDAY, NOTHING):
        driver = points_drivers.Driver("linear" if session.name == WEAR else "constant", measure="distance")
        size, angle = session.value(rng, rig.contact_friction), float(rng.uniform(-np.pi, np.pi))
        effects = (points_effects.Effect(KINDS[session.name], size, driver, angle),)
    streams = record(rng, rig, planned, Scenario("library" if effects else "none", effects))
    write_bag(folder, streams.serialised(EPOCH + 86_400.0 * session.day), rig.record(), "points_rig")


def _foreign(folder: Path, session: Session) -> None:
    rig, rng = draw_foreign_rig(np.random.default_rng([session.seed, 0])), session.rng
    inputs, effects = draw_inputs(rng, rig, session.pushes, PushDistribution()), ()
    if session.name not in (MONDAY, NOTHING):
        driver = foreign_drivers.Driver("constant", "constant")
        if session.name == WEAR:
            driver = foreign_drivers.Driver("slid_distance", "linear", high=float(inputs.facts.slid.max()))
        size, axis = session.value(rng, rig.contact_friction), float(rng.uniform(-np.pi, np.pi))
        effects = (foreign_effects.Effect(KINDS[session.name], size, driver, axis),)
    motion = engine.simulate(rig, inputs.plan, inputs.facts, inputs.noise, effects)
    write_session(rng, folder, rig, inputs, motion, Change("none"), FIRST_DAY + session.day * DAY)


RIGS: dict[str, Callable[[Path, Session], None]] = {"own": _own, "points": _points, "foreign": _foreign}
