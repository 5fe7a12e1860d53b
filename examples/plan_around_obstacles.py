# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push a square through a gate without touching it. `python -m examples.plan_around_obstacles [--risk P] [--seed K]`.

A model of bags/square_abs_train predicts what each push does, and how uncertain that is. The planner searches for the
sequence that most probably ends in the region beyond the gate. After every push on the simulated rig the slider is
observed and the plan is made again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.train import train_model
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import model_repertoire
from push_predictor.planning.obstacles.around_obstacles import PlannedPushes, plan_around_obstacles
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import PoseTarget
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.simulation.interactive_rig import push_motion
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

TRAINING = Path(__file__).resolve().parents[1] / "bags" / "square_abs_train"
WINDOWS = (2, 4, 6, 8, 12, 16)  # of 0.2 s: pushes of 8 to 64 mm
START = np.array([-0.11, 0.03, 0.4])  # x, y in m, heading in rad
TARGET = PoseTarget(Goal([0.10, 0.0, 0.0], distance=0.015))  # any heading
TABLE = np.array([[-0.25, -0.18], [0.25, -0.18], [0.25, 0.18], [-0.25, 0.18]])
GATE = 0.116  # m; the square is 0.09 m wide
LEFT = np.array([[0.0, GATE / 2.0], [0.02, GATE / 2.0], [0.02, 0.18], [0.0, 0.18]])
LIMIT = 10  # pushes


def main(arguments: Sequence[str] = ()) -> int:
    """Plan and push; the exit status is 0 if the region is reached and nothing was touched."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--risk", type=float, default=0.1, help="accepted probability of touching (default %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the simulated rig's noise (default %(default)s)")
    parser.add_argument(
        "--model", type=Path, help="a model of the square (default: train one on bags/square_abs_train)"
    )
    options = parser.parse_args(arguments)
    model = load_model(options.model) if options.model else trained()
    pushes = model_repertoire(model, windows=WINDOWS)
    scene = Scene(model.rig.outline, TABLE, [LEFT, (LEFT * [1.0, -1.0])[::-1]])
    slider = START
    for count in range(1, LIMIT + 1):
        plan = plan_around_obstacles(pushes, scene, slider, TARGET, options.risk, observed=True)
        if plan is None:
            print(f"No sequence reaches the region with a risk of at most {options.risk:g}.")
            return 1
        print(f"Push {count} of {count - 1 + len(plan.pushes)}: risk of the rest {plan.risk[-1]:.3f}, ", end="")
        print(f"probability to reach the region {plan.probability:.2f}", flush=True)
        path = pushed(plan, slider, 1000 * options.seed + count)
        slider = path[-1]
        if not scene.safe(path).all():
            print("The slider has touched the gate or left the table.")
            return 1
        if TARGET.reached(slider):
            print(f"Region reached with {count} pushes: x {1e3 * slider[0]:.0f} mm, y {1e3 * slider[1]:.0f} mm.")
            return 0
    return 1


def trained() -> PushModel:
    """A model of the recording."""
    return train_model(load_data([TRAINING]), load_rig_for([TRAINING]), "vhgp", name="vhgp")


def pushed(plan: PlannedPushes, slider: Array, seed: int) -> Array:
    """Poses (t, 3) of the slider during the first push of a plan, on the simulated rig."""
    velocity, contact, angle = plan.pushes.inputs[0]
    travel = velocity * 0.2 * plan.pushes.windows[0]
    commands = PushPlan(*np.array([[contact], [angle], [velocity], [travel]]))
    motion = push_motion(SimulationSpec("rect1", "abs", commands, seed=seed), slider[None])
    return np.asarray(motion.slider[0])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
