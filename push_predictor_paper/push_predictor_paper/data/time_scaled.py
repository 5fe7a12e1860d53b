# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The quasi-static claim: pushes of equal travel at growing speed, and models without the speed as an input.

The paper, "Dependence with velocity": under the quasi-static assumption a push made twice as fast has the same outcome
in half the time, so pushes of all speeds, scaled in time to 10 mm/s, may be learned together.
Windows here are the simulator's true motion, at every speed alike: 5 mm are 10 ms at 500 mm/s, one sample of its
100 Hz tracker, so recordings cannot carry them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.push_scores import PushScores, push_scores
from push_predictor.evaluation.splits import FOLDS
from push_predictor.evaluation.validation import compare
from push_predictor.geometry.frames import rotate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.simulation.dynamics import Motion, run
from push_predictor.simulation.outcomes import push_outcomes
from push_predictor.simulation.pushes import APPROACH, CRUISE_BEFORE_TOUCH, PusherPath, PushPlan, pusher_path
from push_predictor.simulation.rig_simulator import SimulationSpec
from push_predictor.simulation.spec import PUSHER_RADIUS, physics_of, start_poses
from push_predictor.types import Array, IntArray
from push_predictor_paper.data.corpus import on_the_table, pair_number
from push_predictor_paper.plan import Plan

SCALED_SPEED = 0.01  # m/s, to which all pushes are scaled
TRAVEL = 0.005  # m of the tip in a window, at every speed
WINDOWS = 4  # of a push
# m/s^2, so that a tip at 500 mm/s, too, starts 4 mm before the touch: a push then meets the same draws at every speed
PROMPT = 0.5**2 / (2.0 * (APPROACH - CRUISE_BEFORE_TOUCH))
MARGIN = 0.0005  # m


@dataclass(frozen=True)
class Bracket:
    """A model of pushes at the slowest `speeds` speeds, `rows` windows of each; with_speed: the speed is an input."""

    kind: str
    speeds: int
    rows: int
    with_speed: bool
    fold: int


def speed_windows(plan: Plan, shape: str, surface: str, number: int) -> PushTable:
    """Windows of pushes at the number-th speed of the plan; each push is at one speed only.

    push_id: number of the speed, number of the push. The tip keeps its contact in 90 % of a window, or it is lost.
    """
    speed = plan.speeds[number]
    spec = _spec(plan, (shape, surface), speed, np.random.default_rng([plan.seed, 7, number]), WINDOWS, number)
    table = push_outcomes(spec, TRAVEL / speed)
    names = np.array([f"{number:02d}-{int(row):05d}" for row in table.push_id.tolist()], dtype="U8")
    return replace(table, push_id=names)


def equal_travel(plan: Plan, shape: str, surface: str, number: int) -> Array:
    """Outcomes (n, 3), m, m, rad in the push frame, of n pushes after TRAVEL of the tip from the first contact.

    They are the same pushes at every speed, with the same contacts, angles, places and noise.
    """
    spec = _spec(plan, (shape, surface), plan.speeds[number], np.random.default_rng([plan.seed, 8]), 1, 99)
    start = start_poses(spec)
    path = pusher_path(spec.pushes, spec.slider.outline, PUSHER_RADIUS, start, spec.acceleration)
    motion = run(physics_of(spec, float(np.max(path.length))), path, start, path.push_time)
    return _first_travel(motion, path)


def score_bracket(windows: Sequence[PushTable], rig: Rig, bracket: Bracket) -> PushScores:
    """Train on the bracket's windows outside a fold of pushes, test on the fold's windows at all speeds.

    Push k at any speed is of fold k % 5: pushes of that number met the same places of the table.
    """
    table = concatenate([table.take(training_rows(table, bracket)) for table in windows[: bracket.speeds]])
    model = train_model(
        _scaled(table, bracket.with_speed),
        rig,
        bracket.kind,
        name=bracket.kind,
        options=TrainingOptions(n_train=len(table), mean="zero", per_path=False, tails=False),
    )
    held = concatenate([table.take(np.flatnonzero(fold_of(table) == bracket.fold)) for table in windows])
    return push_scores(compare(model, _scaled(held, bracket.with_speed)))


def training_rows(table: PushTable, bracket: Bracket) -> IntArray:
    """The bracket's rows of one speed's windows, drawn by rng(fold); fewer rows are a subset of more."""
    others = np.flatnonzero(fold_of(table) != bracket.fold)
    return np.random.default_rng([bracket.fold, len(table)]).permutation(others)[: bracket.rows]


def fold_of(table: PushTable) -> IntArray:
    """Fold (n,) of each window."""
    return np.array([number_of(name)[1] % FOLDS for name in table.push_id.tolist()], dtype=np.int64)


def number_of(push_id: str) -> tuple[int, int]:
    """Number of the speed and of the push."""
    speed, _, push = push_id.partition("-")
    return int(speed), int(push)


def _scaled(table: PushTable, with_speed: bool) -> PushTable:
    """Windows scaled in time to SCALED_SPEED; with_speed: the speed remains an input."""
    inputs = table.inputs.copy()
    if not with_speed:
        inputs[:, 0] = SCALED_SPEED
    return replace(table, inputs=inputs, duration=np.full(len(table), TRAVEL / SCALED_SPEED))


def _spec(
    plan: Plan, pair: tuple[str, str], speed: float, rng: np.random.Generator, windows: int, draw: int
) -> SimulationSpec:
    n = plan.speed_pushes
    travel = windows * TRAVEL + max(plan.speeds) ** 2 / (2.0 * PROMPT) + MARGIN  # the same travel, so the same noise
    pushes = PushPlan(rng.random(n), rng.uniform(-1.5, 1.5, n), np.full(n, speed), np.full(n, travel))
    number = 200_000 + 1000 * pair_number(*pair) + draw
    return on_the_table(SimulationSpec(*pair, pushes, acceleration=PROMPT), plan.seed, number)


def _first_travel(motion: Motion, path: PusherPath) -> Array:
    rows, steps = np.arange(len(motion.time)), motion.time[:, 1]
    touch = np.hypot(motion.wrench[..., 0], motion.wrench[..., 1]) > 0.0
    first = np.argmax(touch, axis=1)
    last = np.minimum(first + np.round(TRAVEL / path.speed / steps).astype(np.int64), motion.time.shape[1] - 1)
    before, after = motion.slider[rows, first], motion.slider[rows, last]
    ahead = np.arctan2(path.direction[:, 1], path.direction[:, 0])
    moved = np.column_stack([rotate(after[:, :2] - before[:, :2], -ahead), after[:, 2] - before[:, 2]])
    return np.asarray(np.where(np.any(touch, axis=1, keepdims=True), moved, 0.0))
