# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Made-up studies of the paper's claims: pushes whose truth is a formula, small enough to be learned at once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from push_predictor_paper.claims import CLAIMS
from push_predictor_paper.data.corpus import Corpus, PushSet
from push_predictor_paper.data.repetitions import PATH_POINTS, RepeatedGrid, Repetitions, contact_on_first_side
from push_predictor_paper.plan import GRID_SPEED, QUICK, SPEEDS, Plan
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Evidence, judged
from push_predictor_paper.work import Work

from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

PLAN: Plan = replace(
    QUICK,
    speeds=SPEEDS,
    sizes=(20, 40),
    seeds=2,
    pushes=40,
    reference_pushes=40,
    contacts=3,
    angle_step=0.75,
    repetitions=20,
)
PAIRS = (("rect1", "plywood"), ("rect1", "abs"), ("ellip1", "plywood"), ("ellip1", "abs"))


def rig_of(shape: str, surface: str) -> Rig:
    """A rig of the MIT set."""
    return Rig(shape, shape_outline(shape), 0.00475, surface, 0.837)


def truth(inputs: Array) -> tuple[Array, Array]:
    """Mean and sd (n, 3) of outcomes that look like pushes: more forward, less sure with the angle."""
    velocity, contact, angle = inputs.T
    way, lever = 0.2 * velocity, np.sin(8.0 * np.pi * contact)
    mean = np.column_stack([way * np.cos(angle), 0.3 * way * np.sin(angle), 8.0 * way * lever * np.cos(angle)])
    sd = np.column_stack([0.05 * way, 0.05 * way, 0.5 * way]) * (1.0 + np.abs(angle))[:, None]
    return mean, sd


def made_up_table(pushes: int, windows: int, speeds: tuple[float, ...], seed: int = 0) -> PushTable:
    """Windows of pushes drawn from `truth`; the windows of a push are alike in their inputs."""
    rng = np.random.default_rng(seed)
    speed = rng.permutation(np.resize(np.asarray(speeds), pushes))
    start = np.column_stack([speed, rng.random(pushes), rng.uniform(-1.4, 1.4, pushes)])
    inputs = np.repeat(start, windows, axis=0)
    inputs[:, 2] += 0.01 * rng.standard_normal(len(inputs))
    mean, sd = truth(inputs)
    names = np.repeat([f"push-{k:05d}" for k in range(pushes)], windows)
    return PushTable(inputs, np.full(len(inputs), 0.2), mean + sd * rng.standard_normal(mean.shape), names)


def made_up_corpus(speeds: tuple[float, ...] = SPEEDS) -> Corpus:
    """Four sets whose truth is the same formula."""
    sets = {p: PushSet(made_up_table(40, 3, speeds, k), rig_of(*p)) for k, p in enumerate(PAIRS)}
    return Corpus("simulated", f"made up: {len(sets)} sets of 40 pushes", sets, PAIRS[0])


def made_up_grid(plan: Plan = PLAN, surface: str = "plywood", seed: int = 0) -> RepeatedGrid:
    """Repetitions drawn from `truth`, with straight paths to two and a half times the first window's outcome."""
    rig = rig_of("rect1", surface)
    places = [(fraction, angle) for fraction in plan.grid_fractions.tolist() for angle in plan.grid_angles.tolist()]
    rng = np.random.default_rng(seed)
    cells = [made_up_repetitions(rng, rig, fraction, angle, plan.repetitions) for fraction, angle in places]
    return RepeatedGrid("rect1", surface, rig, plan.grid_fractions, plan.grid_angles, tuple(cells))


def made_up_repetitions(
    rng: np.random.Generator, rig: Rig, fraction: float, angle: float, repetitions: int
) -> Repetitions:
    """One push of the grid, drawn from `truth`."""
    contact = float(contact_on_first_side(rig.outline, np.array(fraction)))
    inputs = np.tile([GRID_SPEED, contact, angle], (repetitions, 1))
    mean, sd = truth(inputs)
    outcomes = mean + sd * rng.standard_normal(mean.shape)
    paths = outcomes[:, None, :] * np.linspace(0.0, 2.5, PATH_POINTS)[None, :, None]
    return Repetitions(fraction, angle, repetitions, inputs, outcomes, paths)


def learning_set(plan: Plan, shape: str, surface: str, keep: Path | None) -> PushSet:
    """Replace the function of the same name in data.corpus: drawn from `truth` instead of simulated."""
    pair = (shape, surface)
    return PushSet(made_up_table(plan.pushes_of(pair), 4, plan.speeds, PAIRS.index(pair)), rig_of(*pair))


def repeat_push(
    plan: Plan, shape: str, surface: str, number: int, fraction: float, angle: float, again: int, keep: Path | None
) -> Repetitions:
    """Replace the function of the same name in data.repetitions: drawn from `truth` instead of simulated."""
    rng = np.random.default_rng([PAIRS.index((shape, surface)), number])
    return made_up_repetitions(rng, rig_of(shape, surface), fraction, angle, again)


def made_up_study(folder: Path, plan: Plan = PLAN) -> Study:
    """All of it, pictures and kept results in the folder."""
    grids = {surface: made_up_grid(plan, surface, k) for k, surface in enumerate(("plywood", "abs"))}
    return Study(plan, Work(folder / "work", cores=1), folder, made_up_corpus(), (), grids)


def verdict_on(section: str, claim: str, evidence: Evidence) -> str:
    """The verdict of the report on this evidence for a claim."""
    return judged(CLAIMS[section][claim], evidence).verdict
