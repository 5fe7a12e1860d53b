# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Make one recording pair with its truth: rig, training recording, hidden change, new recording."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.foreign import engine
from benchmarks.foreign.catalogue import CHANNELS, GROUP_SHARES
from benchmarks.foreign.change import Answer, Change, draw_change, draw_distribution
from benchmarks.foreign.clean_ratio import outcomes
from benchmarks.foreign.conditions import PushFacts
from benchmarks.foreign.motion import PushMotion
from benchmarks.foreign.noise import ProcessNoise, draw_process_noise
from benchmarks.foreign.plan import Plan, PushDistribution, draw_plan
from benchmarks.foreign.rig import Rig, draw_rig
from benchmarks.foreign.scalars import draw_scalars
from benchmarks.foreign.sensing import sense
from benchmarks.foreign.session import Track, lay_out
from benchmarks.support.bags import write_bag
from benchmarks.support.truths import change_over_noise, group_at, write_truth

FIRST_DAY = 1_790_000_000_000_000_000  # ns since 1970
DAY = 86_400_000_000_000  # ns
JUDGED = 150  # pushes of the new recording from which the clean ratio is computed


@dataclass(frozen=True)
class RecordingSpec:
    """What to make: `number` of `count` recordings of the set `seed`, with numbers of pushes."""

    seed: int
    number: int
    count: int
    training: int
    later: int


@dataclass(frozen=True)
class SessionInputs:
    """One of the two recordings before it is changed and simulated."""

    plan: Plan
    scalars: dict[str, Track]
    facts: PushFacts
    noise: ProcessNoise


def make_recording(spec: RecordingSpec, data: Path, truth: Path) -> None:
    """Write the bags `data`/training and `data`/new and the truth file."""
    seeds = np.random.SeedSequence([spec.seed, spec.number]).spawn(7)
    rig_rng, change_rng, training_rng, new_rng, first_rng, second_rng, other_rng = map(np.random.default_rng, seeds)
    rig = draw_rig(rig_rng)
    training = draw_inputs(training_rng, rig, spec.training, PushDistribution())
    motion = engine.simulate(rig, training.plan, training.facts, training.noise, ())
    write_session(
        first_rng, data / "training", rig, training, motion, Change("none"), FIRST_DAY + 3 * spec.number * DAY
    )

    group = group_at(GROUP_SHARES, _share_of(spec))
    distribution, shifted = draw_distribution(change_rng, group)
    new = draw_inputs(new_rng, rig, spec.later, distribution)
    change = draw_change(change_rng, group, rig, new.facts)
    motion = engine.simulate(rig, new.plan, new.facts, new.noise.scaled(change.noise_ratio), change.effects)
    write_session(second_rng, data / "new", rig, new, motion, change, FIRST_DAY + (3 * spec.number + 1) * DAY)

    ratio = clean_ratio(other_rng, rig, new, motion, change)
    answers = (shifted,) if group == "input_shift" else change.answers
    write_truth(truth, _truth(spec, rig, change.group, new, answers, ratio))


def _share_of(spec: RecordingSpec) -> float:
    """Place of a recording within the shares of the groups, so that a set holds each group in its proportion."""
    ranks = np.random.default_rng([spec.seed, 77]).permutation(spec.count)
    return float((ranks[spec.number] + 0.5) / spec.count)


def draw_inputs(rng: np.random.Generator, rig: Rig, count: int, distribution: PushDistribution) -> SessionInputs:
    """Draw what is pushed in a recording, and the noise."""
    plan = draw_plan(rng, rig, count, distribution)
    scalars = draw_scalars(rng, rig, float(plan.release[-1]) + 1.5)
    noise = draw_process_noise(rng, rig.noise_levels, count)
    return SessionInputs(plan, scalars, _facts(rig, plan, scalars), noise)


def _facts(rig: Rig, plan: Plan, scalars: dict[str, Track]) -> PushFacts:
    """What drives effects, as known from the plan; the slider slides about as far as the tip travels in contact."""
    rest = np.concatenate([[5.0], plan.touch[1:] - plan.release[:-1]])
    return PushFacts(
        index=np.arange(len(plan), dtype=np.float64),
        time=plan.touch,
        slid=np.cumsum(plan.travel) - plan.travel,
        temperature=scalars["/surface/temperature"].at(plan.touch)[:, 0],
        rest=rest,
        speed=plan.speed,
        edge=np.floor(plan.contact * rig.outline.edges),
    )


def write_session(
    rng: np.random.Generator,
    folder: Path,
    rig: Rig,
    inputs: SessionInputs,
    motion: PushMotion,
    change: Change,
    start: int,
) -> None:
    """Write the bag of a simulated recording; start: ns since 1970."""
    session = lay_out(rig, inputs.plan, motion)
    sensed = sense(rng, rig, session, inputs.scalars, change.faults)
    write_bag(folder, sensed.serialised(start), rig.record(), "foreign")


def clean_ratio(rng: np.random.Generator, rig: Rig, new: SessionInputs, motion: PushMotion, change: Change) -> float:
    """Change of the outcomes in units of the noise, for some of the new pushes from where they really started."""
    if change.empty:
        return 0.0
    rows = np.unique(np.linspace(0, len(new.plan) - 1, JUDGED).astype(np.int64))
    start = np.where(new.plan.stays[rows, None], motion.pose[rows - 1, -1], new.plan.reset_pose[rows])
    plan = new.plan.rows(rows, start)
    facts, touch = new.facts.rows(rows), new.plan.touch[rows]
    other = draw_process_noise(rng, rig.noise_levels, len(rows))
    without = outcomes(rig, engine.simulate(rig, plan, facts, new.noise.rows(rows), ()), touch, ())
    elsewhere = outcomes(rig, engine.simulate(rig, plan, facts, other, ()), touch, ())
    return change_over_noise(outcomes(rig, motion.rows(rows), touch, change.faults), without, elsewhere)


def _truth(
    spec: RecordingSpec, rig: Rig, group: str, new: SessionInputs, answers: tuple[Answer, ...], ratio: float
) -> dict[str, object]:
    """Content of the truth file."""
    first = asdict(answers[0])
    place = answers[0].place
    return {
        "number": spec.number,
        "group": group,
        "seed": spec.seed,
        "engine": "own",
        "shape": rig.shape,
        "surface": rig.surface,
        "friction": rig.table.coefficient,
        "pushes": len(new.plan),
        "training_pushes": spec.training,
        "channel": CHANNELS[group],
        **first,
        "place_time": None if place is None else float(new.plan.touch[int(place)]),
        "second": asdict(answers[1]) if len(answers) > 1 else None,
        "clean_ratio": round(ratio, 4),
    }
