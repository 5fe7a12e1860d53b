# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw the hidden change of a recording, with the right answers about it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.foreign import catalogue
from benchmarks.foreign.catalogue import CHANGE_KINDS, SIZES, ChangeKind
from benchmarks.foreign.conditions import PushFacts
from benchmarks.foreign.drivers import Driver
from benchmarks.foreign.effects import Effect
from benchmarks.foreign.faults import Fault
from benchmarks.foreign.plan import PushDistribution
from benchmarks.foreign.rig import Rig

INSEPARABLE = 0.99  # correlation over the pushes above which two measures of progress count as the same
TORQUE_ARM = 0.035  # m, friction torque of a turning slider over the friction force
DRIFTS = ("push_index", "elapsed_time", "slid_distance")


@dataclass(frozen=True)
class Answer:
    """What is right to say of one effect; `place` is the push index of a step."""

    kind: str = "none"
    names: tuple[str | None, ...] = ()
    covariates: tuple[str, ...] = ()
    form: str = "constant"
    size: str = "none"
    value: float = 0.0
    unit: str = ""
    place: float | None = None


@dataclass(frozen=True)
class Change:
    """The hidden change of a new recording: what it does, and the right answers."""

    group: str
    effects: tuple[Effect, ...] = ()
    faults: tuple[Fault, ...] = ()
    noise_ratio: float = 1.0
    answers: tuple[Answer, ...] = field(default=(Answer(),))

    @property
    def empty(self) -> bool:
        """Whether the physics and the sensors are unchanged."""
        return not self.effects and not self.faults and self.noise_ratio == 1.0


def draw_distribution(rng: np.random.Generator, group: str) -> tuple[PushDistribution, Answer]:
    """How the pushes of the new recording are chosen, and the answer if that is all that changes."""
    rest = float(rng.choice([0.0, 0.0, 0.0, rng.uniform(0.2, 0.4)]))
    usual = PushDistribution(long_rest=rest)
    if group != "input_shift":
        return usual, Answer()
    if rng.random() < 0.5:
        speed = float(rng.choice([0.05, 0.1, 0.15]))
        size = SIZES[(0.05, 0.1, 0.15).index(speed)]
        answer = Answer("faster_pushes", (), ("velocity",), "constant", size, speed, "m/s")
        return replace(usual, speeds=(speed,), speed_shares=(1.0,)), answer
    first, side = float(rng.integers(4)) / 4, float(rng.choice([-1.0, 1.0]))
    angles = (0.3, 1.2) if side > 0 else (-1.2, -0.3)
    answer = Answer("one_sided_pushes", (), ("contact", "angle", "edge"), "constant", "medium", side, "side")
    return replace(usual, contacts=(first, first + 0.25), angles=angles), answer


def draw_change(rng: np.random.Generator, group: str, rig: Rig, facts: PushFacts) -> Change:
    """Draw a change of a group."""
    if group in ("none", "input_shift"):
        return Change(group)
    candidates = [kind for kind, traits in CHANGE_KINDS.items() if traits.group == group]
    count = 2 if group == "library" and rng.random() < catalogue.TWO_EFFECTS / 0.8 else 1
    kinds = [str(kind) for kind in rng.choice(candidates, count, replace=False)]
    if group == "variance":
        size = int(rng.integers(3))
        ratio = CHANGE_KINDS["noise"].sizes[size]
        answer = Answer("noise", (), catalogue.SESSION, "constant", SIZES[size], ratio, "ratio")
        return Change(group, noise_ratio=ratio, answers=(answer,))
    if group == "measurement":
        fault, answer = _draw_fault(rng, kinds[0], facts)
        return Change(group, faults=(fault,), answers=(answer,))
    drawn = [_draw_effect(rng, kind, rig, facts) for kind in kinds]
    return Change(group, tuple(effect for effect, _ in drawn), answers=tuple(answer for _, answer in drawn))


def _draw_fault(rng: np.random.Generator, kind: str, facts: PushFacts) -> tuple[Fault, Answer]:
    traits, size = CHANGE_KINDS[kind], int(rng.integers(3))
    stepping = str(rng.choice(traits.drivers)) == "step"
    push = _draw_step(rng, facts) if stepping else 0
    # A bias may appear at the first touch of the tip: constant all the same for every push.
    since = float(facts.time[push]) - 0.3 if stepping else -np.inf
    if kind == "wrench_bias" and rng.random() < 0.5:
        since = float(facts.time[push])
    sign = float(rng.choice([-1.0, 1.0])) if kind == "frame_rotation" else 1.0
    value = sign * traits.sizes[size]
    answer = Answer(kind, traits.names, traits.constant_covariates, "constant", SIZES[size], value, traits.unit)
    if stepping:
        answer = replace(answer, covariates=DRIFTS, form="step", place=float(push))
    return Fault(kind, value, float(rng.uniform(-np.pi, np.pi)), since), answer


def _draw_effect(rng: np.random.Generator, kind: str, rig: Rig, facts: PushFacts) -> tuple[Effect, Answer]:
    traits, size = CHANGE_KINDS[kind], int(rng.integers(3))
    value = traits.sizes[size] * _scale(traits, rig) * _draw_sign(rng, traits, traits.sizes[size], rig)
    names = [name for name in traits.drivers if name != "edge" or rig.outline.edges > 1]
    driver, covariates = _draw_driver(rng, str(rng.choice(names)), rig, facts)
    place = rng.uniform(-0.05, 0.05, 2)
    effect = Effect(kind, value, driver, float(_draw_axis(rng, kind)), (float(place[0]), float(place[1])))
    constant = driver.name in ("constant", "rest")
    answer = Answer(
        kind,
        traits.names,
        traits.constant_covariates if constant else covariates,
        "saturating" if driver.name == "rest" else traits.constant_form if constant else driver.form,
        SIZES[size],
        value,
        traits.unit,
        driver.at if driver.name == "step" else None,
    )
    return effect, answer


def _scale(traits: ChangeKind, rig: Rig) -> float:
    """Forces and torques from outside come in shares of the friction, so that none moves the slider alone."""
    force = rig.table.coefficient * rig.weight
    return {"": 1.0, "force": force, "torque": TORQUE_ARM * force}[traits.scale]


def _draw_sign(rng: np.random.Generator, traits: ChangeKind, size: float, rig: Rig) -> float:
    """Either sign, but friction of the tip cannot fall below about zero."""
    if not traits.signed or ("contact_friction" in traits.names and size > rig.contact_friction - 0.04):
        return 1.0
    return float(rng.choice([-1.0, 1.0]))


def _draw_axis(rng: np.random.Generator, kind: str) -> float:
    return float(rng.uniform(0, 1) if kind == "worn_edge" else rng.uniform(-np.pi, np.pi))


def _draw_step(rng: np.random.Generator, facts: PushFacts) -> int:
    return int(len(facts.index) * rng.uniform(0.25, 0.75))


def _draw_driver(rng: np.random.Generator, name: str, rig: Rig, facts: PushFacts) -> tuple[Driver, tuple[str, ...]]:
    """A driver of the new recording and the covariates that are right for it."""
    if name == "step":
        return Driver("step", "step", at=float(_draw_step(rng, facts))), DRIFTS
    if name in DRIFTS:
        quantity = _progress(facts)[name]
        form = str(rng.choice(["linear", "saturating"]))
        return Driver(name, form, low=0.0, high=float(quantity.max())), inseparable(name, facts)
    if name == "temperature":
        low, high = float(facts.temperature.min()), float(facts.temperature.max())
        return Driver(name, "linear", low=low, high=high), (catalogue.TEMPERATURE,)
    if name == "place":
        x, y = rng.uniform(-0.05, 0.05, 2)
        return Driver(name, "map", place=(float(x), float(y))), ("slider_x", "slider_y")
    if name == "heading":
        return Driver(name, "periodic", at=float(rng.uniform(-np.pi, np.pi))), ("slider_heading",)
    if name == "edge":
        return Driver(name, "category", at=float(rng.integers(rig.outline.edges))), ("edge", "contact")
    if name == "speed":
        return Driver(name, "linear", low=0.0, high=0.02), ("velocity",)
    return Driver(name, "constant"), ()


def _progress(facts: PushFacts) -> dict[str, np.ndarray]:
    return {"push_index": facts.index, "elapsed_time": facts.time, "slid_distance": facts.slid}


def inseparable(name: str, facts: PushFacts) -> tuple[str, ...]:
    """`name` and the other measures of progress that run practically parallel to it in this recording."""
    progress = _progress(facts)
    others = [other for other in progress if other != name]
    close = [other for other in others if np.corrcoef(progress[name], progress[other])[0, 1] > INSEPARABLE]
    return (name, *close)
