# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Hidden effects for blind recordings: mechanism, driver, size and the right answer.

The registry is separate: nothing in push_predictor.residuals reads it, and it reads nothing there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.simulation.changes import Changes, Conditions, Moment
from push_predictor.simulation.physics import PushNoise, knot_count, noise_from_draws
from push_predictor.simulation.sensors import Faults
from push_predictor.simulation.slider import pressure_patterns, support_points
from push_predictor.types import Array

SIZES = ("small", "medium", "large")
TEMPERATURE, HUMIDITY = "surface/temperature", "room/humidity"
LONGEST_WAY = 0.06  # m of a tip


@dataclass(frozen=True, eq=False)
class World:
    """A recording to be simulated: outline, weight (N), friction, conditions of its pushes, random generator."""

    outline: Outline
    weight: float
    friction: float
    conditions: Conditions
    rng: np.random.Generator


Strength = Callable[[Moment], Array]
Acts = Callable[[float, Strength, World], Changes | Faults]


@dataclass(frozen=True)
class Kind:
    """A mechanism of the simulator.

    names: the correct names in a trace; None means that it is not in the library. channel: motion, wrench, measurement,
    variance, none. sizes: small, medium, large in `unit`. drivers: those of DRIVERS that it may depend on. constant:
    the covariates of a constant effect; alone: factor on its size then. only_smaller: a negative size below this value
    is made positive.
    """

    name: str
    names: tuple[str | None, ...]
    channel: str
    unit: str
    sizes: tuple[float, float, float]
    acts: Acts
    drivers: tuple[str, ...] = ("constant",)
    constant: tuple[str, ...] = ("model_inputs", "session")
    only_smaller: float = np.inf
    alone: float = 1.0


@dataclass(frozen=True)
class Driver:
    """What an effect depends on.

    covariates: names as in docs/reference/trace.md. form: see models.effects.driver_basis.
    """

    name: str
    covariates: tuple[str, ...]
    form: str
    polygon_only: bool = False


@dataclass(frozen=True)
class Drawn:
    """An effect as drawn: the truth about a recording.

    course: linear, saturating, step or the driver's own. place: of a step, in the unit of the driver. act: what
    changes, with that of the second effect if there are two.
    """

    kind: str
    channel: str
    names: tuple[str | None, ...]
    covariates: tuple[str, ...]
    form: str
    size: str
    value: float
    unit: str
    course: str = ""
    place: float | None = None
    act: Changes | Faults = field(default_factory=Changes, compare=False, repr=False)
    second: Drawn | None = None

    def described(self) -> dict[str, Any]:
        """The truth for its file; of a second effect under the key `second`."""
        facts = {name: value for name, value in vars(self).items() if name not in ("act", "second")}
        return {**facts, "second": self.second.described() if self.second else None}


def draw(kind: Kind, size: str, world: World) -> Drawn:
    """Draw driver, form, sign and direction of an effect of one kind and size."""
    usable = [name for name in kind.drivers if len(world.outline.vertices) < 12 or not DRIVERS[name].polygon_only]
    driver = DRIVERS[str(world.rng.choice(usable))]
    value = kind.sizes[SIZES.index(size)] * float(world.rng.choice([-1.0, 1.0]))
    value *= kind.alone if driver.name == "constant" else 1.0
    value = abs(value) if value < 0.0 and -value > kind.only_smaller else value
    strength, shape, place = _strength(driver, world)
    covariates = kind.constant if driver.name == "constant" else driver.covariates
    form = "step" if shape == "step" else driver.form
    return Drawn(
        kind.name, kind.channel, kind.names, covariates, form, size, value, kind.unit, shape, place,
        kind.acts(value, strength, world),
    )  # fmt: skip


def with_second(first: Drawn, world: World) -> Drawn:
    """An effect of the library and another one that changes other properties of the rig."""
    acting = _laws(first.act)
    for place in world.rng.permutation(len(IN_LIBRARY)):
        other = draw(IN_LIBRARY[place], str(world.rng.choice(SIZES)), world)
        laws = _laws(other.act)
        if not acting.keys() & laws.keys():
            return replace(first, act=Changes(**acting, **laws), second=other)
    raise AssertionError("the library changes several properties")


def _laws(act: Changes | Faults) -> dict[str, Any]:
    """The changed properties of the rig by their names in Changes."""
    assert isinstance(act, Changes)  # the library has no errors of measurement
    return {name: law for name, law in vars(act).items() if callable(law)}


def undisturbed() -> Drawn:
    """No effect: the recording is like the training recording."""
    return Drawn("none", "none", (), (), "constant", "none", 0.0, "")


def _strength(driver: Driver, world: World) -> tuple[Strength, str, float | None]:
    """Strength of an effect at a moment, 0 to 1 over the recording; its course; the place of a step."""
    if driver.name in SPECIAL:
        return SPECIAL[driver.name](world), driver.name, None
    name = "push_index" if driver.name == "onset" else driver.name
    values = world.conditions.values[name]
    low, high = float(values.min()), float(values.max())
    shape = str(world.rng.choice(COURSES.get(driver.form, ("linear",))))
    place = low + float(world.rng.uniform(0.3, 0.7)) * (high - low)

    def strength(moment: Moment) -> Array:
        value = moment.conditions.values[name]
        share = (value - low) / max(high - low, 1e-12)
        return np.asarray(SHAPES[shape](share) if shape != "step" else (value >= place).astype(np.float64))

    return strength, shape, place if shape == "step" else None


def _always(world: World) -> Strength:
    return lambda moment: np.ones(len(moment.travelled))


def _on_an_edge(world: World) -> Strength:
    edge = int(world.rng.integers(len(world.outline.vertices)))
    return lambda moment: (world.outline.edge(moment.contact)[0] == edge).astype(np.float64)


def _in_a_patch(world: World) -> Strength:
    centre, width = world.rng.uniform(-0.05, 0.05, 2), 0.05

    def strength(moment: Moment) -> Array:
        return np.asarray(np.exp(-np.sum((moment.pose[:, :2] - centre) ** 2, axis=1) / (2.0 * width**2)))

    return strength


def _around(world: World) -> Strength:
    phase = float(world.rng.uniform(-np.pi, np.pi))
    return lambda moment: 0.5 * np.cos(moment.conditions.values["push_heading"] - phase)


SHAPES: Mapping[str, Callable[[Array], Array]] = {
    "linear": lambda share: share,
    "saturating": lambda share: (1.0 - np.exp(-4.0 * share)) / (1.0 - np.exp(-4.0)),
}
COURSES = {"linear": ("linear", "linear", "saturating", "step"), "step": ("step",)}  # of a form, by their shares
SPECIAL: Mapping[str, Callable[[World], Strength]] = {
    "constant": _always,
    "edge": _on_an_edge,
    "place": _in_a_patch,
    "push_heading": _around,
}
DRIVERS = {
    driver.name: driver
    for driver in (
        Driver("constant", (), "constant"),
        Driver("slid_distance", ("slid_distance",), "linear"),
        Driver("elapsed_time", ("elapsed_time",), "linear"),
        Driver("push_index", ("push_index",), "linear"),
        Driver("onset", ("push_index", "elapsed_time", "slid_distance"), "step"),
        Driver("dwell_time", ("dwell_time",), "linear"),
        Driver("velocity", ("velocity",), "quadratic"),
        Driver(TEMPERATURE, (f"topic:/{TEMPERATURE}",), "linear"),
        Driver(HUMIDITY, (f"topic:/{HUMIDITY}",), "linear"),
        Driver("edge", ("edge",), "category", polygon_only=True),
        Driver("place", ("slider_x", "slider_y"), "map"),
        Driver("push_heading", ("push_heading", "slider_heading"), "periodic"),
    )
}
DRIFTS = ("slid_distance", "elapsed_time", "push_index", TEMPERATURE, HUMIDITY)


def _rod(value: float, strength: Strength, world: World) -> Changes:
    return Changes(contact_friction=lambda moment: value * strength(moment))


def _spread(value: float, strength: Strength, world: World) -> Changes:
    points = support_points(world.outline)
    square = np.sum(points**2, axis=1)
    pattern = square / square.mean() - 1.0
    return Changes(load=lambda moment: value * strength(moment)[:, None] * pattern)


def _shifted(value: float, strength: Strength, world: World) -> Changes:
    points = support_points(world.outline)
    pattern = points @ _unit(world) / np.mean(points**2)
    return Changes(load=lambda moment: value * strength(moment)[:, None] * pattern)


def _grain(value: float, strength: Strength, world: World) -> Changes:
    axis = _unit(world)
    return Changes(grain=lambda moment: value * strength(moment)[:, None] * axis)


def _runners(value: float, strength: Strength, world: World) -> Changes:
    axis = _unit(world)

    def grain(moment: Moment) -> Array:
        return rotate(value * strength(moment)[:, None] * axis, 2.0 * moment.pose[:, 2])

    return Changes(grain=grain)


def _tilt(value: float, strength: Strength, world: World) -> Changes:
    pull = value * world.weight * np.array([*_unit(world), 0.0])
    return Changes(pull=lambda moment: strength(moment)[:, None] * pull)


def _slippery_table(value: float, strength: Strength, world: World) -> Changes:
    return Changes(grip=lambda moment: np.exp(value * strength(moment)))


def _ballast(value: float, strength: Strength, world: World) -> Changes:
    return Changes(added_mass=abs(value))


def _viscous(value: float, strength: Strength, world: World) -> Changes:
    drag = abs(value) * world.weight * world.friction / 0.02
    return Changes(viscosity=lambda moment: np.full(len(moment.travelled), drag))


def _breakaway(value: float, strength: Strength, world: World) -> Changes:
    """The contact sticks at first, the longer the rod was away; rubbed off over the first millimetres."""

    def friction(moment: Moment) -> Array:
        given = moment.conditions.values
        pushed = np.maximum(moment.travelled - given["approach"], 0.0)
        return np.asarray(abs(value) * np.log1p(given["dwell_time"]) * np.exp(-pushed / 0.004))

    return Changes(contact_friction=friction)


def _worn_spot(value: float, strength: Strength, world: World) -> Changes:
    place, width = float(world.rng.random()), 0.03

    def friction(moment: Moment) -> Array:
        away = (moment.contact - place + 0.5) % 1.0 - 0.5
        return np.asarray(value * np.exp(-(away**2) / (2.0 * width**2)))

    return Changes(contact_friction=friction)


def _cable(value: float, strength: Strength, world: World) -> Changes:
    """An elastic cable pulls the slider to where it hangs from, the farther the stronger."""
    anchor = world.rng.uniform(-0.1, 0.1, 2)

    def pull(moment: Moment) -> Array:
        force = abs(value) * world.weight * world.friction * (anchor - moment.pose[:, :2]) / 0.1
        return np.column_stack([force, np.zeros(len(force))])

    return Changes(pull=pull)


def _twisted_cable(value: float, strength: Strength, world: World) -> Changes:
    torque = value * world.weight * world.friction * float(np.sqrt(world.outline.area)) / 2.0
    return Changes(pull=lambda moment: np.tile([0.0, 0.0, torque], (len(moment.travelled), 1)))


def _uneven_load(value: float, strength: Strength, world: World) -> Changes:
    points, n, knots = support_points(world.outline), len(world.conditions.row), knot_count(LONGEST_WAY)
    draws = pressure_patterns(points, n * (knots + 1), world.rng).reshape(n, knots + 1, -1)
    extra = _Extra(noise_from_draws(draws))
    return Changes(load=lambda moment: value * strength(moment)[:, None] * extra.at(moment))


def _patchy_rod(value: float, strength: Strength, world: World) -> Changes:
    draws = world.rng.standard_normal((len(world.conditions.row), knot_count(LONGEST_WAY) + 1, 1))
    extra = _Extra(noise_from_draws(draws))
    return Changes(contact_friction=lambda moment: value * strength(moment) * extra.at(moment)[:, 0])


@dataclass(frozen=True, eq=False)
class _Extra:
    """Noise of a whole plan, looked up for the pushes that run together."""

    noise: PushNoise

    def at(self, moment: Moment) -> Array:
        return self.noise.take(moment.conditions.row).at(moment.travelled)


def _late_clock(value: float, strength: Strength, world: World) -> Faults:
    return Faults(clock_offset=value)


def _turned_frame(value: float, strength: Strength, world: World) -> Faults:
    return Faults(frame_rotation=value)


def _fault_along(name: str, value: float, strength: Strength, world: World) -> Faults:
    x, y = (float(part) for part in value * _unit(world))
    return Faults(frame_shift=(x, y)) if name == "frame_shift" else Faults(tool_offset=(x, y))


def _biased(value: float, strength: Strength, world: World) -> Faults:
    x, y = (float(part) for part in value * _unit(world))
    return Faults(wrench_bias=(x, y, 0.0))


def _bending(value: float, strength: Strength, world: World) -> Faults:
    return Faults(compliance=abs(value) / (world.weight * world.friction))


def _unit(world: World) -> Array:
    turn = float(world.rng.uniform(-np.pi, np.pi))
    return np.array([np.cos(turn), np.sin(turn)])


SIDES = ("edge", "model_inputs", "session")
HEADED = ("push_heading", "slider_heading", "session")
IN_LIBRARY = (
    Kind("contact_friction", ("contact_friction",), "motion", "1", (0.1, 0.25, 0.5), _rod,
         ("constant", "onset", "onset", *DRIFTS, *DRIFTS, "dwell_time", "velocity", "edge", "place", "push_heading"),
         only_smaller=0.2),
    Kind("pressure_spread", ("pressure_spread",), "motion", "1", (0.7, 1.5, 2.5), _spread,
         ("constant", "onset", *DRIFTS)),
    Kind("centre_of_friction", ("centre_of_friction",), "motion", "m", (0.005, 0.012, 0.024), _shifted,
         ("constant", "onset", *DRIFTS), SIDES, alone=0.6),
    Kind("anisotropic_friction", ("anisotropic_friction",), "motion", "1", (0.2, 0.45, 0.75), _grain,
         ("constant", "constant", "onset", *DRIFTS), HEADED, alone=0.3),
    Kind("body_anisotropy", ("body_anisotropy",), "motion", "1", (0.2, 0.45, 0.75), _runners,
         ("constant", "constant", "onset", *DRIFTS), SIDES, alone=0.4),
    Kind("tilted_surface", ("tilted_surface",), "motion", "N/N", (0.025, 0.05, 0.1), _tilt,
         ("constant", "constant", "onset", *DRIFTS), HEADED, alone=0.25),
)  # fmt: skip
OUTSIDE = (
    Kind("breakaway", (None, "contact_friction"), "motion", "1", (0.1, 0.2, 0.4), _breakaway,
         constant=("dwell_time", "time_since_contact")),
    Kind("worn_spot", (None, "contact_friction"), "motion", "1", (0.1, 0.15, 0.22), _worn_spot,
         constant=("contact", "edge", "model_inputs", "session"), only_smaller=0.22),
    Kind("cable", (None, "tilted_surface"), "motion", "N/N at 0.1 m", (0.1, 0.2, 0.4), _cable,
         constant=("slider_x", "slider_y")),
    Kind("twisted_cable", (None,), "motion", "N/N", (0.05, 0.12, 0.3), _twisted_cable),
    Kind("bending_rod", (None, "tool_offset"), "motion", "m at full friction", (3e-4, 1e-3, 3e-3), _bending,
         constant=("model_inputs", "session", "contact", "angle", "contact_gap", "edge")),
)  # fmt: skip
WRENCH_ONLY = (
    Kind("surface_friction", ("surface_friction",), "wrench", "1", (0.1, 0.2, 0.4), _slippery_table,
         ("constant", *DRIFTS)),
    Kind("ballast", ("surface_friction",), "wrench", "kg", (0.1, 0.2, 0.4), _ballast),
    Kind("viscous_drag", ("surface_friction", None), "wrench", "N/N at 20 mm/s", (0.2, 0.5, 1.5), _viscous,
         constant=("velocity", "model_inputs", "session")),
)  # fmt: skip
MEASUREMENT = (
    Kind("clock_offset", ("clock_offset",), "measurement", "s", (0.005, 0.015, 0.04), _late_clock),
    Kind("frame_rotation", ("frame_rotation",), "measurement", "rad", (0.01, 0.03, 0.08),
         _turned_frame),
    Kind("frame_shift", ("frame_shift",), "measurement", "m", (3e-4, 1e-3, 2.5e-3),
         partial(_fault_along, "frame_shift")),
    Kind("tool_offset", ("tool_offset", "frame_shift"), "measurement", "m", (3e-4, 1e-3, 2.5e-3),
         partial(_fault_along, "tool_offset")),
    Kind("wrench_bias", ("wrench_bias",), "measurement", "N", (0.1, 0.2, 0.5), _biased),
)  # fmt: skip
VARIANCE = (
    Kind("uneven_load", (), "variance", "1", (0.3, 0.6, 1.0), _uneven_load, DRIFTS),
    Kind("patchy_rod", (), "variance", "1", (0.05, 0.1, 0.2), _patchy_rod, DRIFTS),
)
GROUPS: Mapping[str, tuple[Kind, ...]] = {
    "library": IN_LIBRARY,
    "outside": OUTSIDE,
    "wrench": WRENCH_ONLY,
    "measurement": MEASUREMENT,
    "variance": VARIANCE,
}
