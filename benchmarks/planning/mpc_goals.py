# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sampling MPC of examples/mpc.py on many goals of the simulated rig, next to `choose_push`.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.planning.mpc_goals [--goals 200] [--tolerance 0.002 0.05] [--model FILE]

A goal lies within 60 mm and 0.6 rad. It is reached if the slider rests within the tolerances (m, rad). Rig time counts:
0.1 s for a window, PLACING s to place the tip. Goals, table and noise are the same for all. On the changed rig the tip
has twice the friction, and the load lies 8 mm off the centre; the adapted model has seen the pushes of the deployed
model's MPC to other goals there. The models predict in this process.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.blind.scores import wilson
from benchmarks.planning.closed_loops import LIMIT, Command, Planner, run
from benchmarks.support.scripts import parser_of, piped, ruled
from examples.mpc import OUT, SamplingMpc
from examples.square import TABLE, WINDOW, square_model, square_pusher, square_spec
from push_predictor.adaptation import Adaptation
from push_predictor.geometry.frames import paired
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import TabulatedModel, tabulate
from push_predictor.planning.choose import choose_push
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import model_repertoire
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.simulation.changes import Changes, Moment
from push_predictor.simulation.slider import support_points
from push_predictor.simulation.spec import CONTACT_FRICTION, SimulationSpec
from push_predictor.types import Array

BUDGET = 6.0  # s of rig time
FARTHEST, TURNED = 0.06, 0.6  # of goals: m, rad
LENGTHS, SPEEDS = (2, 4, 6, 8, 10, 12, 16), (0.02, 0.05)  # of choose_push: windows, m/s
FRICTION, OFFSET = 2.0 * CONTACT_FRICTION, 0.008  # of the changed rig; m
CALIBRATION, SEED = 20, 20  # goals of the pushes that the adapted model has seen
HEAD = "| rig | planner | reached in 6 s (%) | reached in 20 s (%) |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run every planner and print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--goals", type=int, default=200, help="number of goals (default %(default)s)")
    parser.add_argument("--model", type=Path, default=OUT / "square.pushmodel", help="a file; trained if there is none")
    parser.add_argument("--tolerance", type=float, nargs=2, default=(0.002, 0.05), help="m, rad (default %(default)s)")
    options = parser.parse_args(arguments)
    model, drawn = square_model(options.model), drawn_goals(options.goals + CALIBRATION, *options.tolerance)
    goals, others, predictor = drawn[: options.goals], drawn[options.goals :], tabulate(model)
    plain, changed = square_spec(SEED), changed_spec(SEED)
    print(ruled(HEAD))
    for speed in SPEEDS:
        _report(f"plain | `choose_push`, {1e3 * speed:.0f} mm/s", choosers(predictor, speed, goals), goals, plain)
    typical = model.predict_rows(model.training.inputs, model.training.duration).covariance.mean(axis=0)
    _report("plain | MPC", mpcs(predictor, goals), goals, plain)
    _report("plain | MPC, constant covariance", mpcs(predictor, goals, typical), goals, plain)
    _report("changed | MPC", mpcs(predictor, goals), goals, changed)
    seen = concatenate(run(mpcs(predictor, others), others, changed).seen)
    adjusted = tabulate(adapted(model, seen))
    _report(f"changed | MPC, adapted in {len(seen.pushes)} pushes", mpcs(adjusted, goals), goals, changed)
    return 0


def drawn_goals(count: int, distance: float, turn: float) -> list[Goal]:
    """Goals spread evenly over a disc about the slider's start at the origin."""
    rng = np.random.default_rng(SEED)
    radius, bearing = FARTHEST * np.sqrt(rng.random(count)), rng.uniform(-np.pi, np.pi, count)
    places = radius[:, None] * paired(np.cos(bearing), np.sin(bearing))
    poses = np.column_stack([places, rng.uniform(-TURNED, TURNED, count)])
    return [Goal(pose, distance, turn) for pose in poses]


def changed_spec(seed: int) -> SimulationSpec:
    """The rig with more friction at the tip, and its load OFFSET m along the slider's y axis."""
    spec = square_spec(seed)
    y = support_points(spec.slider.outline)[:, 1]

    def load(moment: Moment) -> Array:
        return np.tile(OFFSET * y / np.mean(y**2), (len(moment.pose), 1))

    return replace(spec, contact_friction=FRICTION, changes=Changes(load=load))


def mpcs(predictor: TabulatedModel, goals: Sequence[Goal], constant: Array | None = None) -> list[Planner]:
    """The sampling MPC for each goal; constant (3, 3): covariance of every window instead of the model's."""
    pusher = square_pusher(predictor.model)
    scene = Scene(pusher.outline, TABLE)

    def predict(inputs: Array) -> Prediction:
        answer = predictor.predict_rows(inputs, np.full(len(inputs), WINDOW))
        return answer if constant is None else replace(answer, covariance=np.tile(constant, (len(inputs), 1, 1)))

    def planner(goal: Goal) -> Planner:
        mpc = SamplingMpc(predict, pusher, goal, scene)

        def plan(slider: Array, tip: Array | None) -> Command:
            window, place, *_ = mpc.plan(slider, tip)
            return Command(window, place, 1)

        return plan

    return [planner(goal) for goal in goals]


def choosers(predictor: TabulatedModel, speed: float, goals: Sequence[Goal]) -> list[Planner]:
    """choose_push for each goal, with straight pushes at one speed."""
    pushes, outline = model_repertoire(predictor, speed, LENGTHS), predictor.model.rig.outline

    def planner(goal: Goal) -> Planner:
        def plan(slider: Array, tip: Array | None) -> Command:
            choice = choose_push(pushes, slider, goal)
            assert choice is not None  # the goal is not reached yet
            _, contact, angle = choice.push.inputs[0]
            x, y = outline.inward_normal(np.array([contact]))[0]
            heading = slider[2] + np.arctan2(y, x) + angle
            return Command(np.array([speed, contact, heading]), True, int(choice.push.windows[0]))

        return plan

    return [planner(goal) for goal in goals]


def adapted(model: PushModel, seen: PushTable) -> PushModel:
    """The model after these pushes."""
    adaptation = Adaptation(model)
    for push in seen.pushes:
        adaptation.update(seen.take(seen.push_id == push))
    return adaptation.adapted


def _report(name: str, planners: Sequence[Planner], goals: Sequence[Goal], spec: SimulationSpec) -> None:
    """Run and print a row of the table."""
    runs, n = run(planners, goals, spec), len(goals)
    cells = []
    for limit in (BUDGET, LIMIT):
        count = int(np.sum(runs.reached & (runs.spent <= limit + 1e-9)))
        low, high = wilson(count, n)
        cells.append(f"{100.0 * count / n:.1f} ({100.0 * low:.1f} to {100.0 * high:.1f})")
    print(piped([name, *cells]), flush=True)


if __name__ == "__main__":
    sys.exit(main())
