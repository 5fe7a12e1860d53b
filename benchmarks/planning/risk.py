# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Does knowing the uncertainty pay where a push can fail? Gates and table edges on the simulated rig.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.planning.risk --out FOLDER [--tasks NAME ...] [--problems FROM TO]
    python -m benchmarks.planning.risk --table FOLDER

The planner (planning/obstacles), the pushes, their means, the problems and the noise of each push are the same; only
the covariance differs (VARIANTS). A run ends if the slider touches an obstacle or its centre leaves the table. Every
run is appended to FOLDER/runs.jsonl at once, with what was promised before each push; runs that are there already are
skipped. The thresholds of equal risk are applied afterwards (risk_table.py).
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.planning.risk_table import VARIANTS, tables
from benchmarks.planning.risk_tasks import TASKS, Problem, Task, inner_target, problem
from benchmarks.support.scripts import parser_of
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.planning.model_repertoire import candidate_pushes, persistent_fraction
from push_predictor.planning.obstacles.around_obstacles import PlannedPushes, plan_around_obstacles
from push_predictor.planning.repertoire import Repertoire, repertoire
from push_predictor.planning.unscented import PusherGeometry
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.simulation.interactive_rig import push_motion
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

TRAINING = Path(__file__).resolve().parents[2] / "bags" / "square_abs_train"
WINDOW = 0.2  # s
VELOCITY = 0.02  # m/s, of most of the training pushes
IDLE = (0.125, 0.0, 0.001)  # contact, angle, travel of a push on a slider whose run is over; its outcome is ignored
WINDOWS = (2, 4, 6, 8, 12, 16)  # 8 to 64 mm
MOST = 8  # pushes of a plan
LOOSEST = 0.5  # risk above which no plan is made
MARGINS = (0.0, 0.001, 0.002, 0.004, 0.007, 0.012, 0.02, 0.03, 0.04, 0.05)  # m, without uncertainty
PIECE = 50  # problems in lockstep
SEED = 7
STRIDE = 10  # steps of the simulator between two checks: less than half a millimetre


@dataclass
class Run:
    """A problem under way: the slider's pose (3,), what was promised before each push, the result."""

    problem: Problem
    slider: Array
    promised: list[dict[str, float]] = field(default_factory=list)
    ahead: list[Array] = field(default_factory=list)  # the rest of a plan that is not made again
    pushes: int = 0
    result: str = ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the problems, or print the tables."""
    parser = parser_of(__doc__)
    parser.add_argument("--out", type=Path, help="folder of the results")
    parser.add_argument("--table", type=Path, help="print the tables of a folder")
    parser.add_argument("--tasks", nargs="*", default=[task.name for task in TASKS])
    parser.add_argument("--variants", nargs="*", default=VARIANTS)
    parser.add_argument("--problems", type=int, nargs=2, default=(0, 500), metavar=("FROM", "TO"))
    parser.add_argument("--model", type=Path, help="a model of bags/square_abs_train (default: train one)")
    options = parser.parse_args(arguments)
    if options.table:
        print(tables(options.table / "runs.jsonl"))
        return 0
    options.out.mkdir(parents=True, exist_ok=True)
    model = load_model(options.model) if options.model else trained()
    variants = {name: of for name, of in repertoires(model).items() if name in options.variants}
    tasks = [task for task in TASKS if task.name in options.tasks]
    start, stop = options.problems
    for first in range(start, stop, PIECE):
        for task in tasks:
            numbers = range(first, min(first + PIECE, stop))
            _run_piece(options.out / "runs.jsonl", task, numbers, variants, model)
    return 0


def trained(tails: bool = False) -> PushModel:
    """A plain VHGP of the training recording."""
    options = TrainingOptions(tails=tails, mean="zero")
    return train_model(load_data([TRAINING]), load_rig_for([TRAINING]), "vhgp", name="square_abs", options=options)


def repertoires(model: PushModel) -> dict[str, Repertoire]:
    """A repertoire per variant: the same pushes and means, the covariance of the variant.

    constant: the mean over the training windows for every window, with its correlations and the persistent part.
    independent: the model's variances, without correlation between outputs, windows taken as independent.
    """
    tabulated = tabulate(model)

    def own(inputs: Array) -> Prediction:
        return tabulated.predict_rows(inputs, np.full(len(inputs), WINDOW))

    typical = model.predict_rows(model.training.inputs, model.training.duration).covariance.mean(axis=0)

    def constant(inputs: Array) -> Prediction:
        return replace(own(inputs), covariance=np.tile(typical, (len(inputs), 1, 1)))

    def diagonal(inputs: Array) -> Prediction:
        answer = own(inputs)
        return replace(answer, covariance=answer.covariance * np.eye(3))

    tip = PusherGeometry(model.rig.outline, model.rig.pusher_radius, WINDOW)
    lines, persistent = candidate_pushes(model.rig.outline, VELOCITY), persistent_fraction(model, VELOCITY * WINDOW)
    made = [repertoire(constant, tip, lines, WINDOWS, persistent), repertoire(diagonal, tip, lines, WINDOWS, 0.0)]
    full = repertoire(own, tip, lines, WINDOWS, persistent)
    keys = [_keys(of) for of in (*made, full)]
    common = sorted(set.intersection(*map(set, keys)))
    rows = [np.array([places[key] for key in common]) for places in keys]
    pushes, mean = full.pushes.take(rows[2]), full.mean[rows[2]]
    covariances = [of.covariance[places] for of, places in zip((*made, full), rows, strict=True)]
    covariances.insert(0, np.zeros_like(covariances[0]))
    return {name: Repertoire(pushes, mean, of) for name, of in zip(VARIANTS, covariances, strict=True)}


def _keys(of: Repertoire) -> dict[tuple[float, ...], int]:
    """Rows of the pushes of a repertoire by their inputs and length."""
    pushes = np.column_stack([of.pushes.inputs, of.pushes.windows])
    return {tuple(push): row for row, push in enumerate(pushes.tolist())}


def plan(task: Task, of: Repertoire, problem: Problem, slider: Array) -> tuple[PlannedPushes, dict[str, float]] | None:
    """The plan from where the slider is, and what it promises; without uncertainty that with the largest margin from
    obstacles, edges and the target's bounds."""

    def planned(margin: float = 0.0) -> PlannedPushes | None:
        target = inner_target(problem.target, margin)
        return plan_around_obstacles(
            of, problem.scene, slider, target, LOOSEST, margin=margin, observed=task.observed, most_pushes=MOST
        )

    if of.covariance.any():
        found = planned()
        return None if found is None else (found, {"risk": float(found.risk[-1]), "probability": found.probability})
    best: tuple[PlannedPushes, float] | None = None
    low, high = 0, len(MARGINS)
    while low < high:
        middle = (low + high) // 2
        found = planned(MARGINS[middle])
        best, low, high = (best, low, middle) if found is None else ((found, MARGINS[middle]), middle + 1, high)
    return None if best is None else (best[0], {"margin": best[1], "probability": best[0].probability})


def _run_piece(path: Path, task: Task, numbers: range, variants: Mapping[str, Repertoire], model: PushModel) -> None:
    done = set()
    if path.exists():
        done = {(row["task"], row["variant"], row["problem"]) for row in map(json.loads, path.open())}
    for name, of in variants.items():
        if all((task.name, name, number) in done for number in numbers):
            continue
        begun = time.monotonic()
        runs = [Run(drawn, drawn.start) for drawn in (problem(task, n, model.rig.outline) for n in numbers)]
        for turn in range(task.limit):
            _push_all(task, of, runs, SEED + 1000 * numbers.start + turn)
        with path.open("a") as file:
            for number, run in zip(numbers, runs, strict=True):
                row = {"task": task.name, "variant": name, "problem": number, "result": run.result or "missed"}
                file.write(json.dumps({**row, "pushes": run.pushes, "promised": run.promised}) + "\n")
        print(f"{task.name}, {name}, {numbers.start}: {time.monotonic() - begun:.0f} s", file=sys.stderr, flush=True)


def _push_all(task: Task, of: Repertoire, runs: list[Run], seed: int) -> None:
    """Plan and execute one push of every run that is not over; a row has the same noise for all variants."""
    commands = np.tile(np.array([IDLE[0], IDLE[1], VELOCITY, IDLE[2]]), (len(runs), 1))
    for row, run in enumerate(runs):
        if not run.result:
            _decide(task, of, run)
        if not run.result:
            commands[row] = run.ahead.pop(0)
    moving = [run for run in runs if not run.result]
    if not moving:
        return
    spec = SimulationSpec("rect1", "abs", PushPlan(*commands.T), seed=seed)
    path = push_motion(spec, np.array([run.slider for run in runs])).slider
    for run, poses in zip(runs, path, strict=True):
        if not run.result:
            _judge(task, run, np.vstack([poses[::STRIDE], poses[-1:]]))


def _decide(task: Task, of: Repertoire, run: Run) -> None:
    if run.ahead:
        return
    found = plan(task, of, run.problem, run.slider)
    if found is None:
        run.result = "refused"
        return
    pushes = found[0].pushes
    velocity, contact, angle = pushes.inputs.T
    commands = list(np.column_stack([contact, angle, velocity, velocity * WINDOW * pushes.windows]))
    run.ahead = commands[:1] if task.observed else commands
    run.promised.append({**found[1], "planned": len(commands)})


def _judge(task: Task, run: Run, poses: Array) -> None:
    """What came of a push whose motion is poses (t, 3)."""
    run.pushes, run.slider = run.pushes + 1, poses[-1]
    if not run.problem.scene.safe(poses).all():
        run.result = "failed"
    elif (task.observed or not run.ahead) and run.problem.target.reached(run.slider):
        run.result = "reached"
    elif not task.observed and not run.ahead:
        run.result = "missed"


if __name__ == "__main__":
    sys.exit(main())
