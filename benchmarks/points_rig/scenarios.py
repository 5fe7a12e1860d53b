# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Which hidden change a pair of recordings has, and what its truth file records of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from benchmarks.points_rig.drivers import Driver, draw_driver
from benchmarks.points_rig.effects import KINDS, LIBRARY, UNNAMED, WRENCH, Effect, Kind
from benchmarks.points_rig.rigs import Rig
from benchmarks.points_rig.sessions import InputShift, Session
from benchmarks.support.truths import group_at

SIZES = ("small", "medium", "large")
SHARES = {"none": 0.33, "input_shift": 0.05, "wrench": 0.05, "measurement": 0.09, "variance": 0.03, "motion": 0.45}
TWO_EFFECTS, UNNAMED_SHARE = 1 / 6, 1 / 5  # of the motion effects
GOLDEN = 0.6180339887498949
FAULTS: dict[str, tuple[tuple[float, float, float], str]] = {
    "clock_offset": ((0.008, 0.02, 0.05), "s"),
    "frame_rotation": ((0.01, 0.03, 0.08), "rad"),
    "frame_shift": ((0.0005, 0.001, 0.0025), "m"),
    "wrench_bias": ((0.2, 0.5, 1.0), "N"),
}
RATIOS = (1.5, 2.0, 3.0)
SHIFTED = {"new_speeds": ["velocity"], "one_side": ["contact", "edge"], "angle_range": ["angle"]}
MAX_RADIUS = 0.88  # of the support points' largest distance: as far as the load's mean distance can go


@dataclass(frozen=True)
class Fault:
    """A fault of a sensor in the new recording: kind, value in its unit, world direction (rad), begin as a share."""

    kind: str
    value: float
    angle: float
    begin: float


@dataclass(frozen=True)
class Scenario:
    """The hidden change of one pair of recordings."""

    group: str
    effects: tuple[Effect, ...] = ()
    fault: Fault | None = None
    noise_ratio: float = 1.0
    shift: InputShift | None = None


def draw_scenario(random: np.random.Generator, rig: Rig, seed: int, number: int) -> Scenario:
    """Draw a hidden change; a golden-ratio sequence over the numbers keeps the groups' shares."""
    place = (np.random.default_rng(seed).random() + GOLDEN * number) % 1.0
    group = group_at(SHARES, place)
    size = int(random.integers(3))
    if group == "motion":
        return _draw_motion(random, rig)
    if group == "wrench":
        return Scenario(group, (_draw_effect(random, rig, "surface_friction", WRENCH["surface_friction"]),))
    if group == "measurement":
        return Scenario(group, fault=_draw_fault(random, size))
    if group == "variance":
        return Scenario(group, noise_ratio=RATIOS[size])
    if group == "input_shift":
        return Scenario(group, shift=get_args(InputShift)[random.integers(3)])
    return Scenario(group)


def describe(scenario: Scenario, session: Session) -> dict[str, object]:
    """The truth's entries about the change."""
    motion = {"library": "motion", "outside": "motion", "input_shift": "none"}
    entries: dict[str, object] = _entries("none", [], [], "constant", "none", 0.0, "1") | {
        "second": None,
        "place": None,
    }
    if scenario.shift is not None:
        entries |= {"kind": scenario.shift, "covariates": SHIFTED[scenario.shift]}
    if scenario.noise_ratio != 1.0:
        size = SIZES[RATIOS.index(scenario.noise_ratio)]
        entries |= _entries("noise", [None], ["session", "model_inputs"], "constant", size, scenario.noise_ratio, "1")
    if scenario.fault is not None:
        entries |= _describe_fault(scenario.fault, session)
    if scenario.effects:
        entries |= _describe_effect(scenario.effects[0], session)
    if len(scenario.effects) > 1:
        entries |= {"second": _describe_effect(scenario.effects[1], session)}
    return entries | {"channel": motion.get(scenario.group, scenario.group)}


def _draw_motion(random: np.random.Generator, rig: Rig) -> Scenario:
    chance = random.random()
    if chance < UNNAMED_SHARE:
        kind = str(random.choice(list(UNNAMED)))
        return Scenario("outside", (_draw_effect(random, rig, kind, UNNAMED[kind]),))
    count = 2 if chance < UNNAMED_SHARE + TWO_EFFECTS else 1
    kinds = random.choice(list(LIBRARY), count, replace=False)
    return Scenario("library", tuple(_draw_effect(random, rig, str(kind), LIBRARY[str(kind)]) for kind in kinds))


def _draw_effect(random: np.random.Generator, rig: Rig, name: str, kind: Kind) -> Effect:
    """Draw size, sign, driver and direction; a value the rig cannot have is turned round."""
    value = kind.values[random.integers(3)]
    if kind.signed and random.random() < 0.5:
        value = -value
    radius = np.linalg.norm(rig.supports - rig.load_centre, axis=1).max()
    impossible = {
        "contact_friction": rig.contact_friction + value < 0.04,
        "pressure_spread": (1 + value) * rig.load_radius > MAX_RADIUS * radius,
    }
    if impossible.get(name, False):
        value = -value
    return Effect(name, value, draw_driver(random, rig, kind.drivers), float(random.uniform(-np.pi, np.pi)))


def _draw_fault(random: np.random.Generator, size: int) -> Fault:
    kind = str(random.choice(list(FAULTS)))
    sign = -1.0 if kind == "frame_rotation" and random.random() < 0.5 else 1.0
    begin = float(random.uniform(0.2, 0.7)) if kind == "wrench_bias" and random.random() < 0.5 else 0.0
    return Fault(kind, sign * FAULTS[kind][0][size], float(random.uniform(-np.pi, np.pi)), round(begin, 3))


def _describe_fault(fault: Fault, session: Session) -> dict[str, object]:
    values, unit = FAULTS[fault.kind]
    late = fault.begin > 0.0
    driver = Driver("step" if late else "constant", place=fault.begin)
    covariates = driver.covariates(session, ("session", "model_inputs"))
    size, place = SIZES[values.index(abs(fault.value))], {"place": driver.at_push(session)}
    return _entries(fault.kind, [fault.kind], covariates, driver.form, size, fault.value, unit) | place


def _describe_effect(effect: Effect, session: Session) -> dict[str, object]:
    kind, driver = KINDS[effect.kind], effect.driver
    names = [None] if effect.kind in UNNAMED else [effect.kind]
    size = SIZES[kind.values.index(abs(effect.value))]
    covariates, place = driver.covariates(session, kind.constant), {"place": driver.at_push(session)}
    return _entries(effect.kind, names, covariates, driver.form, size, effect.value, kind.unit) | place


def _entries(
    kind: str, names: Sequence[str | None], covariates: list[str], form: str, size: str, value: float, unit: str
) -> dict[str, object]:
    """The entries that describe one change."""
    entries = {"kind": kind, "names": list(names), "covariates": covariates, "form": form}
    return entries | {"size": size, "value": value, "unit": unit}
