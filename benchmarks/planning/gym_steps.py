# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Steps a second of the Gymnasium environment and of MuJoCo at the same task, on one core, in one run.

    pip install mujoco==4.0.0 mujoco-core==4.0.0 mujoco-studio==4.0.0 gymnasium
    OPENBLAS_NUM_THREADS=1 python -m benchmarks.planning.gym_steps [--count 4096] [--timestep 0.002]

The task: a window of 0.2 s, in which a round tip pushes the square of the shipped model at a random contact, angle and
velocity of its domain. The environment also draws the noise, computes reward and observation, and begins new episodes.
MuJoCo computes the motion alone, without noise: a box on a plane with four contacts, and a tip that is so heavy that it
keeps its velocity. Single: `step` of the environment, and one call of mj_step for the window. Vectorised: `count`
sliders in one call, with MuJoCo's own batched rollout. Processor time, medians of rounds in turn.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from time import process_time
from timeit import Timer
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco import rollout

from push_predictor.gym import ID
from push_predictor.gym.task import push_task
from push_predictor.models.push_model import PushModel
from push_predictor.planning.straight_drive import start_drive
from push_predictor.types import Array

ROUNDS, SINGLE, STEPS = 5, 300, 20
SCENE = """
<mujoco><option timestep="{timestep}"/><worldbody>
  <geom type="plane" size="1 1 1" friction="{table}"/><body pos="0 0 {height}"><freejoint/>
    <geom type="box" size="{half} {half} {height}" mass="{mass}" friction="{table}" conaffinity="3"/></body>
  <body pos="0 0 {height}"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
    <geom type="cylinder" size="{radius} {height}" mass="1000" friction="{tip}" contype="2" conaffinity="0"/></body>
</worldbody></mujoco>"""  # of two frictions the larger counts; the tip does not touch the table
HALF_HEIGHT, TABLE, TIP = 0.0065, 0.13, 0.15  # m; friction of table and tip


def main(arguments: list[str] | None = None) -> int:
    """Measure both and print the rates."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4096, help="sliders at once (default %(default)s)")
    parser.add_argument("--timestep", type=float, default=0.002, help="of MuJoCo, s (default %(default)s, its own)")
    options = parser.parse_args(arguments)
    task = push_task()
    model, duration = task.model.model, task.model.model.usual_duration
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (options.count, 3))
    pushes, steps = task.inputs(actions), round(duration / options.timestep)
    physics = mujoco.MjModel.from_xml_string(scene(model, options.timestep))
    starts, data = states(physics, model, pushes), mujoco.MjData(physics)
    many = gymnasium.make_vec(ID, num_envs=options.count, vectorization_mode="vector_entry_point")
    many.reset(seed=0)
    predicted = task.model.predict_rows(pushes, np.full(len(pushes), duration)).mean[:, 0]
    batch = partial(rollout.rollout, physics, data, starts, nstep=steps)
    ends = batch()[0][:, -1]
    along = starts[:, -2:] / np.linalg.norm(starts[:, -2:], axis=1)[:, None]
    alike = np.corrcoef(predicted, np.sum(ends[:, 1:3] * along, axis=1))[0, 1]
    print(f"MuJoCo {mujoco.__version__}, timestep {options.timestep:g} s; correlation of the motions {alike:.2f}")
    one = partial(episode, gymnasium.make(ID), actions)
    compare("single", SINGLE, one, partial(windows, physics, data, starts, steps), 1)
    compare(f"{options.count} at once", options.count, partial(many.step, actions), batch, STEPS)
    return 0


def scene(model: PushModel, timestep: float) -> str:
    """The model's square and a tip, as MuJoCo reads them."""
    rig, half = model.rig, float(np.abs(model.rig.outline.vertices).max())
    sizes = {"half": half, "height": HALF_HEIGHT, "radius": rig.pusher_radius, "mass": rig.object_mass}
    return SCENE.format(timestep=timestep, table=TABLE, tip=TIP, **sizes)


def states(physics: Any, model: PushModel, pushes: Array) -> Array:
    """MuJoCo's states (n, k) at the start of pushes (n, 3): slider at the origin, tip in contact and moving."""
    drive, _ = start_drive(model.rig.outline, model.rig.pusher_radius, np.zeros((len(pushes), 3)), pushes)
    data, spec = mujoco.MjData(physics), mujoco.mjtState.mjSTATE_FULLPHYSICS
    found = np.empty((len(pushes), mujoco.mj_stateSize(physics, spec)))
    for row, (place, velocity) in enumerate(zip(drive.start, drive.velocities, strict=True)):
        data.qpos[7:], data.qvel[6:] = place, velocity
        mujoco.mj_getState(physics, data, found[row], spec)
    return found


def episode(env: Any, actions: Array) -> None:
    """SINGLE steps of the environment for one slider."""
    env.reset(seed=0)
    for action in actions[:SINGLE]:
        if any(env.step(action)[2:4]):
            env.reset()


def windows(physics: Any, data: Any, starts: Array, steps: int) -> None:
    """SINGLE windows of MuJoCo for one slider."""
    for start in starts[:SINGLE]:
        mujoco.mj_setState(physics, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_step(physics, data, nstep=steps)


def compare(name: str, count: int, ours: Callable[[], object], theirs: Callable[[], object], times: int) -> None:
    """Print the steps per second of processor time, medians of rounds in turn.

    count: steps of a call; times: calls of ours in a round, against one of theirs.
    """
    pair = [(times, Timer(ours, timer=process_time)), (1, Timer(theirs, timer=process_time))]
    spent = [[timer.timeit(calls) / (calls * count) for calls, timer in pair] for _ in range(ROUNDS)]
    mine, other = 1.0 / np.median(spent, axis=0)
    print(f"{name}: {mine:.0f} steps/s, MuJoCo {other:.0f}, ratio {mine / other:.1f}")


if __name__ == "__main__":
    sys.exit(main())
