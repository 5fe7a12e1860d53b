# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A planner that uses the services: bring a square to a goal pose with few pushes. `python -m examples.plan_pushes`.

predict_server loads a model of bags/square_abs_train. The planner requests predictions of thousands of pushes once, in
batches. For each push it then chooses (planning/choose.py), requests the probability of success from rollout_pushes,
and pushes on the simulated rig on which the recording was made. The slider stays where each push leaves it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from examples.planner_client import PlannerClient
from examples.planner_picture import Step, draw_pushes
from examples.processes import LOGS, node
from push_predictor.errors import PushPredictorError
from push_predictor.geometry.outline import Outline
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.planning.choose import Choice, choose_push
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import candidate_pushes, persistent_fraction
from push_predictor.planning.repertoire import Repertoire, repertoire
from push_predictor.planning.unscented import PusherGeometry
from push_predictor.simulation.interactive_rig import push_once
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

ROOT = Path(__file__).resolve().parents[1]
TRAINING = ROOT / "bags" / "square_abs_train"
OUT = ROOT / "out" / "planner"
WINDOW, VELOCITY = 0.2, 0.02  # s, m/s: as in most of the training pushes
WINDOWS = (1, 2, 3, 4, 5, 6, 8)  # 4 to 32 mm
START = np.array([-0.05, -0.02, 0.4])
GOAL = Goal(np.array([0.03, 0.02, 0.0]), distance=0.002, turn=0.05)
PROBABILITY = 0.9
LIMIT = 10  # pushes
SAMPLES = 500


def main(arguments: Sequence[str] = ()) -> int:
    """Plan and push; the exit status is 0 if the goal is reached."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--model", type=Path, help="a model file of the square (default: train one on bags/square_abs_train)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the simulated rig's noise (default %(default)s)")
    options = parser.parse_args(arguments)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    for folder in (OUT, LOGS):
        folder.mkdir(parents=True, exist_ok=True)
    path = options.model or _trained()
    print(f"Model: {path}", flush=True)
    model = load_model(path)
    with node("predict_server", {"models": [str(path)]}, "planner_server"), PlannerClient(WINDOW) as client:
        pushes = _asked(client, model)
        steps = list(_pushed(client, pushes, options.seed))
    reached = bool(GOAL.reached(GOAL.ahead(steps[-1].after)))
    print(f"Goal {'reached' if reached else 'NOT reached'} with {len(steps)} pushes.")
    _draw(steps, model.rig.outline)
    return 0 if reached else 1


def _trained() -> Path:
    """The model file, trained unless an earlier run has written it."""
    path = OUT / "vhgp.pushmodel"
    if not path.exists():
        command = ["train", str(TRAINING), "--kind", "vhgp", "--mean", "zero", "--n-train", "500", "--out", str(path)]
        subprocess.run([sys.executable, "-m", "push_predictor.cli", *command], check=True)
    return path


def _asked(client: PlannerClient, model: PushModel) -> Repertoire:
    """The pushes that the model knows, with predictions from the service."""
    outline = model.rig.outline
    lines = candidate_pushes(outline, VELOCITY)
    persistent = persistent_fraction(model, VELOCITY * WINDOW)
    client.predict(lines[:1])  # returns when the server is up
    begun = time.monotonic()
    pushes = repertoire(
        client.predict, PusherGeometry(outline, model.rig.pusher_radius, WINDOW), lines, WINDOWS, persistent
    )
    print(f"{len(pushes)} pushes in the model's domain, predicted in {time.monotonic() - begun:.1f} s.", flush=True)
    return pushes


def _pushed(client: PlannerClient, pushes: Repertoire, seed: int) -> Iterator[Step]:
    """Push until the goal is reached, at most LIMIT times."""
    slider = START
    for count in range(1, LIMIT + 1):
        choice = choose_push(pushes, slider, GOAL, PROBABILITY)
        if choice is None:
            return
        samples = client.outcomes(slider, choice.push, SAMPLES, seed=count)
        after = push_once(_spec(choice, 1000 * seed + count), slider[None])[0]
        _print_step(count, slider, choice, samples, after)
        yield Step(slider, choice, _travel(choice), samples, after)
        slider = after


def _spec(choice: Choice, seed: int) -> SimulationSpec:
    """The chosen push on the simulated rig: slider and table of the recording."""
    velocity, contact, angle = choice.push.inputs[0]
    plan = PushPlan(*np.array([[contact], [angle], [velocity], [_travel(choice)]]))
    return SimulationSpec("rect1", "abs", plan, seed=seed)


def _travel(choice: Choice) -> float:
    """Distance travelled by the tip, m."""
    return float(choice.push.inputs[0, 0] * WINDOW * choice.push.windows[0])


def _print_step(count: int, before: Array, choice: Choice, samples: Array, after: Array) -> None:
    _, contact, angle = choice.push.inputs[0]
    travel = 1e3 * _travel(choice)
    print(f"Push {count}. The goal is at {_pose(GOAL.ahead(before))} (x, y, heading) in the slider's frame.")
    print(
        f"   chosen     contact {contact:.3f}, angle {angle:+.2f} rad, {travel:.0f} mm; "
        f"{choice.expected:.1f} pushes expected"
    )
    sure = float(GOAL.reached(GOAL.ahead(samples)).mean())
    print(f"   It reaches the goal with probability {choice.probability:.2f} (by rollout_pushes: {sure:.2f}).")
    print(f"   predicted  {_pose(choice.mean)}, sd {_pose(np.sqrt(np.diag(choice.covariance)))}")
    print(
        f"   observed   {_pose(after)}: {'at the goal' if GOAL.reached(GOAL.ahead(after)) else 'not at the goal yet'}"
    )
    sys.stdout.flush()


def _pose(pose: Array) -> str:
    return f"{1e3 * pose[0]:.1f} mm, {1e3 * pose[1]:.1f} mm, {pose[2]:.3f} rad"


def _draw(steps: Sequence[Step], outline: Outline) -> None:
    """Write the picture, if matplotlib is installed."""
    try:
        path = draw_pushes(OUT / "pushes.png", steps, GOAL, outline)
    except PushPredictorError as error:
        print(error)
    else:
        print(f"Picture: {path}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
