# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Does knowing the uncertainty pay where a push can fail? A square through a gate, on the simulated rig.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.planning.risk [--problems 200]

Planner, pushes, their means, problems and noise are the same; only the covariance differs: the mean of the training
windows for all, or the VHGP's with the part that persists during a push. A run fails if the slider touches the gate or
falls. At equal risk, a problem is declined if the risk promised before any of its pushes exceeds a threshold: the
largest at which at most 5 % of the other half of the problems fail. Intervals (95 %) resample problems.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from benchmarks.support.scripts import parser_of, piped, ruled
from examples.plan_around_obstacles import WINDOWS, trained
from push_predictor.evaluation.estimate import of_draws
from push_predictor.geometry.outline import Outline
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import candidate_pushes, model_repertoire, persistent_fraction
from push_predictor.planning.obstacles.around_obstacles import plan_around_obstacles
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import PoseTarget
from push_predictor.planning.repertoire import Repertoire, repertoire
from push_predictor.planning.unscented import PusherGeometry
from push_predictor.simulation.interactive_rig import push_motion
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array, BoolArray

VELOCITY, WINDOW = 0.02, 0.2  # m/s, s
IDLE = (0.125, 0.0, VELOCITY, 0.001)  # a push on a slider whose run is over; its outcome is ignored
LOOSEST, RISK = 0.5, 0.05  # risk above which no plan is made; accepted share of failed runs
HALF, TABLE = 0.045, (-0.25, 0.25, -0.18, 0.18)  # m, of the square's side; x from, to, y from, to
STRIDE = 10  # steps of the simulator between two checks: less than half a millimetre
HEAD = "| plan | covariance | reached, % | failed, % | reached at 5 % failures | more than constant, points |"


class Task(NamedTuple):
    """observed: a plan is made again after every push; room beside the square and radius of the region, m."""

    name: str
    observed: bool
    room: tuple[float, float]
    radius: float


TASKS = (Task("fixed", False, (0.02, 0.06), 0.04), Task("made again", True, (0.004, 0.016), 0.02))


@dataclass
class Run:
    """A problem under way: the slider (3,), pushes of its plan, the largest risk promised, what came of it."""

    scene: Scene
    target: PoseTarget
    slider: Array
    ahead: list[Array] = field(default_factory=list)
    promised: float = 0.0
    result: str = ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all problems and print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--problems", type=int, default=200, help="of each task (default %(default)s)")
    count, model = parser.parse_args(arguments).problems, trained()
    own, constant = model_repertoire(model, VELOCITY, WINDOWS), constant_repertoire(model)
    print(ruled(HEAD))
    for task in TASKS:
        base: Array | None = None
        for name, pushes in (("constant", constant), ("push effects", own)):
            runs = [problem(task, number, model.rig.outline) for number in range(count)]
            for turn in range(10):
                push_all(task, pushes, runs, seed=turn)
            reached, failed = (np.array([run.result == what for run in runs]) for what in ("reached", "failed"))
            kept = accepted(np.array([run.promised for run in runs]), failed)
            more = "" if base is None else mean_of((reached & kept) - base)
            base = (reached & kept).astype(np.float64)
            print(piped([task.name, name, *map(mean_of, (reached, failed, reached & kept)), more]), flush=True)
    return 0


def constant_repertoire(model: PushModel) -> Repertoire:
    """The pushes with the covariance of a typical window for each window."""
    typical = model.predict_rows(model.training.inputs, model.training.duration).covariance.mean(axis=0)
    tabulated, lines = tabulate(model), candidate_pushes(model.rig.outline, VELOCITY)

    def predict(inputs: Array) -> Prediction:
        answer = tabulated.predict_rows(inputs, np.full(len(inputs), WINDOW))
        return replace(answer, covariance=np.tile(typical, (len(inputs), 1, 1)))

    tip = PusherGeometry(model.rig.outline, model.rig.pusher_radius, WINDOW)
    return repertoire(predict, tip, lines, WINDOWS, persistent_fraction(model, VELOCITY * WINDOW))


def problem(task: Task, number: int, outline: Outline) -> Run:
    """A square before a gate in a wall, and a region behind it."""
    rng = np.random.default_rng([2026, task.observed, number])
    middle, half = rng.uniform(-0.03, 0.03), HALF + rng.uniform(*task.room)
    walls = [_box(0.0, 0.02, TABLE[2], middle - half), _box(0.0, 0.02, middle + half, TABLE[3])]
    start = np.array([rng.uniform(-0.13, -0.09), middle + rng.uniform(-0.05, 0.05), rng.uniform(-np.pi, np.pi)])
    goal = Goal(np.array([0.10, middle + rng.uniform(-0.03, 0.03), 0.0]), task.radius)
    return Run(Scene(outline, _box(*TABLE), walls), PoseTarget(goal), start)


def _box(x_from: float, x_to: float, y_from: float, y_to: float) -> Array:
    return np.array([[x_from, y_from], [x_to, y_from], [x_to, y_to], [x_from, y_to]])


def push_all(task: Task, of: Repertoire, runs: Sequence[Run], seed: int) -> None:
    """Plan and execute one push of every run that is not over; a row has the same noise for both covariances."""
    for run in runs:
        if not run.result and not run.ahead:
            plan_run(task, of, run)
    commands = np.array([IDLE if run.result else run.ahead.pop(0) for run in runs])
    spec = SimulationSpec("rect1", "abs", PushPlan(*commands.T), seed=seed)
    path = push_motion(spec, np.array([run.slider for run in runs])).slider
    for run, poses in zip(runs, path, strict=True):
        if not run.result:
            run.slider = poses[-1]
            over = task.observed or not run.ahead
            if not run.scene.safe(np.vstack([poses[::STRIDE], poses[-1:]])).all():
                run.result = "failed"
            elif over and run.target.reached(run.slider):
                run.result = "reached"
            elif over and not task.observed:
                run.result = "missed"


def plan_run(task: Task, of: Repertoire, run: Run) -> None:
    """Add the next pushes of a run: one, or a whole plan."""
    found = plan_around_obstacles(of, run.scene, run.slider, run.target, LOOSEST, observed=task.observed)
    if found is None:
        run.result = "refused"
        return
    run.promised = max(run.promised, float(found.risk[-1]))
    velocity, contact, angle = found.pushes.inputs.T
    commands = np.column_stack([contact, angle, velocity, velocity * WINDOW * found.pushes.windows])
    run.ahead = list(commands[:1] if task.observed else commands)


def accepted(promised: Array, failed: BoolArray) -> BoolArray:
    """The problems (n,) whose promised risk is below the threshold that was tuned on the other half."""
    half, kept = np.arange(len(promised)) % 2, np.zeros(len(promised), dtype=np.bool_)
    for k in (0, 1):
        known, lost = promised[half != k], failed[half != k]
        levels = [level for level in np.unique(known) if (lost & (known <= level)).mean() <= RISK]
        kept[half == k] = promised[half == k] <= max(levels, default=-np.inf)
    return kept


def mean_of(values: Array | BoolArray) -> str:
    """Per cent of the problems, with interval."""
    drawn = np.random.default_rng(0).integers(0, len(values), (4000, len(values)))
    return of_draws(100.0 * float(values.mean()), 100.0 * values[drawn].mean(axis=1)).text(".1f")


if __name__ == "__main__":
    sys.exit(main())
