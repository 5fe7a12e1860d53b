# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rig's own engine: implicit rigid-body steps of many pushes at once.

Each push takes the same number of steps, so a step is a fixed share of its travel. The slider's twist at the end of a
step solves its equation of motion (inertia, base friction, tip, outer forces) by Newton's method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.foreign import tip
from benchmarks.foreign.conditions import Conditions, PushFacts, State, ordinary_conditions
from benchmarks.foreign.effects import Effect, changed
from benchmarks.foreign.motion import Line, PushMotion, empty_motion, push_lines, start_waves, torque_about_tip
from benchmarks.foreign.noise import ProcessNoise
from benchmarks.foreign.plan import Plan
from benchmarks.foreign.rig import Rig
from benchmarks.foreign.sliding import base_friction, patch_moments
from benchmarks.support.plane import Array, IntArray, rotate

STEPS = 400
ITERATIONS = 12
TOLERANCE = 3e-4  # of the sliding friction
BATCH = 300  # pushes whose patches fit into the processor's cache


def simulate(rig: Rig, plan: Plan, facts: PushFacts, noise: ProcessNoise, effects: Sequence[Effect]) -> PushMotion:
    """Simulate all pushes of a plan under some effects."""
    motion = empty_motion(plan, STEPS)
    for wave in start_waves(plan.stays.astype(np.int64)):
        for first in range(0, len(wave), BATCH):
            _simulate_batch(rig, plan, facts, noise, effects, wave[first : first + BATCH], motion)
    return motion


def _simulate_batch(
    rig: Rig,
    plan: Plan,
    facts: PushFacts,
    noise: ProcessNoise,
    effects: Sequence[Effect],
    rows: IntArray,
    motion: PushMotion,
) -> None:
    """Simulate the pushes `rows` and write them into `motion`."""
    start = np.where(plan.stays[rows, None], motion.pose[rows - 1, -1], plan.reset_pose[rows])
    line = push_lines(rig, plan, rows, start)
    motion.touch[rows], motion.heading[rows] = line.touch, line.heading
    motion.pose[rows, 0] = start
    batch = _Batch(rig, plan.speed[rows], facts.rows(rows), noise.rows(rows), effects, line)
    slider = _Slider(start, np.zeros((len(rows), 3)), tip.free(len(rows)))
    for step in range(1, STEPS + 1):
        slider = batch.advance(slider, plan.travel[rows] * step / STEPS, plan.travel[rows] / STEPS)
        contact = slider.contact
        motion.pose[rows, step] = slider.pose
        motion.force[rows, step] = rotate(contact.force, slider.pose[:, 2])
        motion.torque[rows, step] = torque_about_tip(contact.point, contact.tip, contact.force)


@dataclass(frozen=True)
class _Slider:
    """Sliders of a batch: poses (m, m, rad), twists in body axes (m/s, rad/s), and their contact with the tip."""

    pose: Array
    twist: Array
    contact: tip.TipContact


class _Batch:
    """Pushes that are advanced together."""

    def __init__(
        self,
        rig: Rig,
        speed: Array,
        facts: PushFacts,
        noise: ProcessNoise,
        effects: Sequence[Effect],
        line: Line,
    ) -> None:
        self._rig = rig
        self._speed = speed
        self._facts = facts
        self._noise = noise
        self._effects = effects
        self._line = line
        self._moments = patch_moments(rig.patches)
        self._mass = np.array([rig.mass, rig.mass, rig.inertia])
        self._scale = rig.table.coefficient * rig.weight * np.array([1.0, 1.0, 0.03])

    def advance(self, slider: _Slider, travelled: Array, step: Array) -> _Slider:
        """The sliders after the tips travelled another `step` m, to `travelled` m in all."""
        contact = self._rig.outline.contact_of(slider.contact.point)
        state = State(slider.pose, contact, travelled, self._facts)
        conditions = ordinary_conditions(self._rig, self._noise, state)
        conditions = changed(conditions, self._effects, state, self._rig)
        return self._solve(slider, conditions, self._line.at(travelled), step / self._speed)

    def _solve(self, before: _Slider, conditions: Conditions, robot: Array, duration: Array) -> _Slider:
        """Solve one implicit step; a step of Newton that does not help is replaced by a safe one."""
        rig, guess, inertia = self._rig, before.twist, self._mass / duration[:, None]
        damping = rig.tip_damping / duration
        mounting = tip.TipMounting(conditions.stiffness, damping, conditions.tip_friction, conditions.normal_tilt)
        lately, bold = np.full(len(guess), np.inf), np.ones(len(guess))
        for _ in range(ITERATIONS):
            moved = _moved(before.pose, guess, duration)
            seen = rotate(robot - moved[:, :2], -moved[:, 2])
            contact = tip.resolve(rig.outline, before.contact, seen, mounting)
            friction, secant, curve = base_friction(rig, self._moments, conditions, guess)
            outer = np.column_stack([rotate(conditions.force, -moved[:, 2]), conditions.torque])
            missing = friction + tip.wrench(contact) + outer - inertia * (guess - before.twist)
            error = np.max(np.abs(missing) / self._scale, axis=1)
            if np.max(error) < TOLERANCE:
                break
            bold = np.where(error < 0.9 * lately, np.minimum(1.0, bold + 0.5), 0.5 * bold)
            lately = error
            matrix = secant - bold[:, None, None] * curve + _contact_matrix(contact, seen, duration)
            matrix = matrix + inertia[:, :, None] * np.eye(3)
            change = np.linalg.solve(matrix, missing[:, :, None])[:, :, 0]
            guess = guess + np.where((error > TOLERANCE)[:, None], change, 0.0)
        return _Slider(_moved(before.pose, guess, duration), guess, contact)


def _moved(pose: Array, twist: Array, duration: Array) -> Array:
    """Poses after `duration` s of a body twist."""
    turn = duration * twist[:, 2]
    shift = rotate(twist[:, :2], pose[:, 2] + turn / 2) * duration[:, None]
    return np.column_stack([pose[:, :2] + shift, pose[:, 2] + turn])


def _contact_matrix(contact: tip.TipContact, robot: Array, duration: Array) -> Array:
    """Negated derivative of the tip's wrench by the body twist."""
    motion = np.zeros((len(robot), 2, 3))
    motion[:, 0, 0] = motion[:, 1, 1] = 1.0
    motion[:, 0, 2], motion[:, 1, 2] = -robot[:, 1], robot[:, 0]
    force = contact.stiffness @ (duration[:, None, None] * motion)
    point = contact.point
    moment = point[:, :1] * force[:, 1] - point[:, 1:] * force[:, 0]
    return np.concatenate([force, moment[:, None, :]], axis=1)
