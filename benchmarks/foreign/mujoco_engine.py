# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The same pushes with MuJoCo: a square box on a plane and a round tip held by a position-controlled spring.

The box rests on its four corners with elliptic friction cones. What MuJoCo expresses of a push's conditions is the
friction of the table and of the tip, forces and torques on the box, and the centre of the load, as a tipping torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.foreign.arrays import Floats, rotate, unit, wrapped
from benchmarks.foreign.conditions import PushFacts, State, ordinary_conditions
from benchmarks.foreign.effects import Effect, changed
from benchmarks.foreign.engine import STEPS
from benchmarks.foreign.motion import PushMotion, empty_motion, push_lines
from benchmarks.foreign.noise import ProcessNoise
from benchmarks.foreign.plan import Plan
from benchmarks.foreign.rig import PUSHER_RADIUS, Rig

# MuJoCo is an optional package without complete type information.
mujoco: Any = import_module("mujoco")

TIME_STEP = 0.0005  # s, at most
HALF_HEIGHT = 0.0125  # m, of the box
TIP_MASS = 0.05  # kg
RUN_UP = 0.0003  # m that the tip drives before it touches, while the box settles
UPDATE = 8  # instants between two updates of the conditions

MODEL = """
<mujoco>
  <option timestep="{step}" cone="elliptic" impratio="20" integrator="implicitfast" gravity="0 0 -9.81"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <geom name="table" type="plane" size="1 1 0.1"/>
    <body name="slider" pos="0 0 {half}">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{tipping} {tipping} {inertia}"/>
      <geom name="slider" type="box" size="{side} {side} {half}"/>
    </body>
    <body name="tip" pos="0 0 0.035">
      <joint name="tip_x" type="slide" axis="1 0 0" damping="{damping}"/>
      <joint name="tip_y" type="slide" axis="0 1 0" damping="{damping}"/>
      <geom name="tip" type="capsule" size="{radius} 0.03" mass="{tip_mass}"/>
    </body>
  </worldbody>
  <contact>
    <pair geom1="table" geom2="slider" condim="3" solref="0.005 1" solimp="0.95 0.99 0.0002"/>
    <pair geom1="tip" geom2="slider" condim="3" solref="0.01 1" solimp="0.95 0.99 0.0002"/>
  </contact>
  <actuator>
    <intvelocity joint="tip_x" kp="{stiffness}" actrange="-1 1"/>
    <intvelocity joint="tip_y" kp="{stiffness}" actrange="-1 1"/>
  </actuator>
</mujoco>
"""


def simulate(rig: Rig, plan: Plan, facts: PushFacts, noise: ProcessNoise, effects: Sequence[Effect]) -> PushMotion:
    """Simulate all pushes of a plan under some effects, one after the other."""
    motion = empty_motion(plan, STEPS)
    scene = _Scene(rig)
    for push in range(len(plan)):
        row = np.array([push])
        start = motion.pose[push - 1, -1] if plan.stays[push] else plan.reset_pose[push]
        line = push_lines(rig, plan, row, start[None])
        motion.touch[push], motion.heading[push] = line.touch[0], line.heading[0]
        push_conditions = _PushConditions(rig, noise.rows(row), effects, facts.rows(row), float(plan.contact[push]))
        scene.place(
            start, push_conditions.at(start, 0.0), line.touch[0], float(plan.speed[push]) * unit(line.heading[0])
        )
        for instant in range(STEPS + 1):
            if instant:
                scene.drive(float(plan.travel[push] / plan.speed[push]) / STEPS)
            if instant % UPDATE == UPDATE - 1:
                scene.set_conditions(push_conditions.at(scene.pose(), plan.travel[push] * instant / STEPS))
            motion.pose[push, instant] = scene.pose()
            motion.force[push, instant], motion.torque[push, instant] = scene.contact()
    return motion


@dataclass(frozen=True)
class _Settings:
    """Conditions in MuJoCo's terms: two frictions, and force (N) and torque (N m) on the box, world axes."""

    table_friction: float
    tip_friction: float
    wrench: Floats


@dataclass(frozen=True)
class _PushConditions:
    """Conditions of one push along its travel."""

    rig: Rig
    noise: ProcessNoise
    effects: Sequence[Effect]
    facts: PushFacts
    contact: float

    def at(self, pose: Floats, travelled: float) -> _Settings:
        """Conditions for the slider at `pose` after `travelled` m."""
        state = State(pose[None], np.array([self.contact]), np.array([travelled]), self.facts)
        conditions = changed(ordinary_conditions(self.rig, self.noise, state), self.effects, state, self.rig)
        # A load off the box's centre tips it as the weight at that place would.
        centre = rotate(conditions.load @ self.rig.patches, pose[2:])[0]
        tipping = self.rig.weight * np.array([-centre[1], centre[0]])
        wrench = np.array([*conditions.force[0], 0.0, *tipping, conditions.torque[0]])
        friction = self.rig.table.coefficient * float(conditions.table_friction[0])
        return _Settings(friction, float(conditions.tip_friction[0]), wrench)


class _Scene:
    """Box and tip in MuJoCo."""

    def __init__(self, rig: Rig) -> None:
        side = float(np.max(rig.outline.vertices))
        damping = rig.tip_damping * rig.stiffness
        text = MODEL.format(
            step=TIME_STEP,
            half=HALF_HEIGHT,
            mass=rig.mass,
            tipping=0.55 * rig.inertia,
            inertia=rig.inertia,
            side=side,
            damping=damping,
            radius=PUSHER_RADIUS,
            tip_mass=TIP_MASS,
            stiffness=rig.stiffness,
        )
        self._lag = rig.tip_damping  # s by which the tip trails its target in free motion
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        self._body = self._model.body("slider").id
        self._tip = self._model.geom("tip").id
        self._heading = 0.0

    def place(self, pose: Floats, settings: _Settings, touch: Floats, velocity: Floats) -> None:
        """Put the box to a pose and drive the tip, at `velocity` m/s, until it is about to touch at `touch`."""
        data, speed = self._data, float(np.linalg.norm(velocity))
        mujoco.mj_resetData(self._model, data)
        self.set_conditions(settings)
        data.qpos[:7] = [*pose[:2], HALF_HEIGHT, np.cos(pose[2] / 2), 0.0, 0.0, np.sin(pose[2] / 2)]
        data.qpos[7:9] = touch - RUN_UP / speed * velocity
        data.act[:] = data.qpos[7:9] + self._lag * velocity
        data.qvel[6:8] = velocity
        data.ctrl[:] = velocity
        self._heading = float(pose[2])
        self.drive(RUN_UP / speed)

    def drive(self, duration: float) -> None:
        """Let `duration` s pass."""
        steps = int(np.ceil(duration / TIME_STEP))
        self._model.opt.timestep = duration / steps
        mujoco.mj_step(self._model, self._data, steps)

    def set_conditions(self, settings: _Settings) -> None:
        """Change frictions and outer forces."""
        self._model.pair_friction[0, :2] = settings.table_friction
        self._model.pair_friction[1, :2] = settings.tip_friction
        self._data.xfrc_applied[self._body] = settings.wrench

    def pose(self) -> Floats:
        """Pose of the box; its heading is continuous."""
        w, x, y, z = self._data.qpos[3:7]
        heading = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        self._heading += float(wrapped(np.array(heading - self._heading)))
        return np.array([*self._data.qpos[:2], self._heading])

    def contact(self) -> tuple[Floats, float]:
        """Force of the tip on the box (N, world axes) and its torque about the tip's centre (N m)."""
        contacts, force, torque, local = self._data.contact, np.zeros(2), 0.0, np.zeros((6, 1))
        for index, geometries in enumerate(contacts.geom.tolist()):
            if self._tip not in geometries:
                continue
            mujoco.mj_contactForce(self._model, self._data, index, local)
            # The contact's frame points from its first body to its second, on which the force acts.
            sign = 1.0 if geometries[0] == self._tip else -1.0
            world = sign * (contacts.frame[index].reshape(3, 3).T @ local[:3, 0])[:2]
            arm = contacts.pos[index, :2] - self._data.geom_xpos[self._tip, :2]
            force, torque = force + world, torque + float(arm[0] * world[1] - arm[1] * world[0])
        return force, torque
