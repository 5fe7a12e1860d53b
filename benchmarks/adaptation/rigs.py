# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings of one rig on two days, of three simulators: on the second day one property of the rig has changed.

Monday's recording is of the plain rig. Tuesday's differ in one property each, from their first push on; with `wear`
the contact friction rises in proportion to the distance slid. Signs and directions are drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
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
from push_predictor.simulation.changes import Changes, Moment
from push_predictor.simulation.physics import GRAVITY
from push_predictor.simulation.rig_simulator import simulate
from push_predictor.types import Array

MONDAY, NOTHING, WEAR = "before", "nothing", "wear"
MONDAY_PUSHES, TUESDAY_PUSHES = 250, 140
KINDS = {  # by change, the name of what acts, the same in the simulators and in the library of mechanisms
    "contact_friction": "contact_friction",
    "pressure": "pressure_spread",
    "anisotropy": "anisotropic_friction",
    WEAR: "contact_friction",
    "tilt": "tilted_surface",
}
CHANGES = (*KINDS, NOTHING)
# Sizes in the units of the simulators' catalogues, medium to large there; those that may be negative are below zero.
SIZES = {
    "own": {"contact_friction": 0.25, "pressure": -1.5, "anisotropy": 0.3, WEAR: 0.5, "tilt": 0.04},
    "points": {"contact_friction": -0.2, "pressure": -0.25, "anisotropy": 0.35, WEAR: 0.4, "tilt": 0.06},
    "foreign": {"contact_friction": -0.25, "pressure": -0.15, "anisotropy": 0.5, WEAR: 0.45, "tilt": 0.06},
}
LEAST_FRICTION = 0.05  # of the contact after a change


def write_day(folder: Path, rig: str, seed: int, name: str) -> None:
    """Write the bag of a recording of a rig, one of RIGS and a seed; name: one of CHANGES, or MONDAY."""
    RIGS[rig](folder, seed, name)


def _own(folder: Path, seed: int, name: str) -> None:
    spec, rng = rig_of(np.random.default_rng([seed, 0]), "before", MONDAY_PUSHES), _rng(seed, name)
    if name != MONDAY:
        spec = later_spec(spec, rng, TUESDAY_PUSHES)
    if name in KINDS:
        known = conditions(spec)
        world = World(spec.slider.outline, spec.slider.mass * GRAVITY, spec.table.friction, known, rng)
        (kind,) = (kind for kind in IN_LIBRARY if kind.name == KINDS[name])
        furthest = float(known.values["slid_distance"].max())

        def strength(moment: Moment) -> Array:
            slid = moment.conditions.values["slid_distance"]
            return slid / furthest if name == WEAR else np.ones(len(slid))

        changes = kind.acts(_size("own", name, rng), strength, world)
        assert isinstance(changes, Changes)  # the library has no errors of measurement
        spec = replace(spec, changes=changes)
    write_recording(folder, simulate(spec))


def _points(folder: Path, seed: int, name: str) -> None:
    rig, rng = draw_points_rig(np.random.default_rng([seed, 0])), _rng(seed, name)
    effects: tuple[points_effects.Effect, ...] = ()
    planned = plan_session(rng, rig, _pushes(name))
    if name in KINDS:
        driver = points_drivers.Driver("linear" if name == WEAR else "constant", measure="distance")
        size, angle = _size("points", name, rng, rig.contact_friction), float(rng.uniform(-np.pi, np.pi))
        effects = (points_effects.Effect(KINDS[name], size, driver, angle),)
    streams = record(rng, rig, planned, Scenario("library", effects))
    write_bag(folder, streams.serialised(EPOCH + 86_400.0 * _day(name)), rig.record(), "points_rig")


def _foreign(folder: Path, seed: int, name: str) -> None:
    rig, rng = draw_foreign_rig(np.random.default_rng([seed, 0])), _rng(seed, name)
    effects: tuple[foreign_effects.Effect, ...] = ()
    inputs = draw_inputs(rng, rig, _pushes(name), PushDistribution())
    if name in KINDS:
        furthest = float(inputs.facts.slid.max())
        driver = foreign_drivers.Driver("slid_distance" if name == WEAR else "constant", "linear", high=furthest)
        size, axis = _size("foreign", name, rng, rig.contact_friction), float(rng.uniform(-np.pi, np.pi))
        effects = (foreign_effects.Effect(KINDS[name], size, driver, axis),)
    motion = engine.simulate(rig, inputs.plan, inputs.facts, inputs.noise, effects)
    write_session(rng, folder, rig, inputs, motion, Change("none"), FIRST_DAY + _day(name) * DAY)


def _pushes(name: str) -> int:
    return MONDAY_PUSHES if name == MONDAY else TUESDAY_PUSHES


def _day(name: str) -> int:
    """Every recording has a day of its own, so that no stamps coincide."""
    return 0 if name == MONDAY else 1 + CHANGES.index(name)


def _rng(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng([seed, 1 + _day(name)])


def _size(rig: str, name: str, rng: np.random.Generator, friction: float = np.inf) -> float:
    size = abs(SIZES[rig][name])
    negative = SIZES[rig][name] < 0.0 and rng.random() < 0.5
    return -size if negative and (name != "contact_friction" or friction - size > LEAST_FRICTION) else size


RIGS: dict[str, Callable[[Path, int, str], None]] = {"own": _own, "points": _points, "foreign": _foreign}
