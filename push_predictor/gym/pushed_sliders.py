# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Many sliders, each pushed by one window a step.

An outcome is a sample of the model's predictive distribution. The errors of one push are correlated from window to
window as in rollouts (planning/persistence.py). Each slider has a random generator, so that what happens to it depends
on its seed and its actions alone.
"""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.touch import displaced
from push_predictor.gym.task import FLAGS, PushTask
from push_predictor.planning.particles import sampled_displacements, windows_of
from push_predictor.planning.persistence import persistence_of
from push_predictor.planning.straight_drive import start_drive
from push_predictor.types import Array, BoolArray, IntArray

BLOCK = 16  # windows for which a slider draws at once: a call of a generator takes a microsecond


class PushedSliders:
    """The state of n sliders.

    poses, before (n, 3): now, and before the last window; inputs (n, 3): of this window, NaN before the first of an
    episode. flags (n,) by name: what the last window has done, false before the first; in_domain: whether the training
    data support it.
    """

    def __init__(self, task: PushTask, count: int) -> None:
        self.task = task
        self.poses, self.before, self.inputs = np.full((3, count, 3), np.nan)
        self.flags = {name: np.zeros(count, dtype=np.bool_) for name in FLAGS}
        self.generators: list[np.random.Generator | None] = [None] * count
        self._drawn, self._used = np.empty((count, BLOCK, 3, 3)), np.full(count, BLOCK)
        self._persistent, self._decaying = np.zeros((2, count, 3))  # standard deviates of the pushes
        self._persistence = persistence_of(task.model.model)
        self._windows = windows_of(task.model.model, task.model.model.usual_duration)

    @property
    def ended(self) -> BoolArray:
        """Whether the episodes have ended, (n,)."""
        return self.flags["is_success"] | self.flags["touches"] | self.flags["off_table"]

    def seed(self, row: int, generator: np.random.Generator) -> None:
        """Draw for a slider from a new generator."""
        self.generators[row], self._used[row] = generator, BLOCK

    def place(self, rows: IntArray) -> None:
        """Begin an episode for sliders (k,)."""
        self.poses[rows] = self.task.starts([self.generators[row] for row in rows.tolist()])
        self.inputs[rows] = np.nan
        for flag in self.flags.values():
            flag[rows] = False

    def push(self, rows: IntArray, actions: Array) -> Array:
        """Push sliders (k,) by a window each, with actions (k, 3), and return the rewards (k,).

        A slider stays where it is if the model has no finite prediction for the push.
        """
        task, before, inputs = self.task, self.poses[rows], self.task.inputs(actions)
        rig = task.model.model.rig
        contact = start_drive(rig.outline, rig.pusher_radius, before, inputs)[1]
        deviates = self._deviates(rows, inputs)
        moved, known = sampled_displacements(task.model, before, contact, self._windows, deviates)
        finite = np.isfinite(moved.sum(axis=1))
        after = displaced(before, contact.touch.heading, np.where(finite[:, None], moved, 0.0))
        self.poses[rows], self.before[rows], self.inputs[rows] = after, before, inputs
        ends = task.ends(after)
        for name, flag in {**ends, "in_domain": known & finite}.items():
            self.flags[name][rows] = flag
        return task.reward(before, after, ends["is_success"])

    def _deviates(self, rows: IntArray, inputs: Array) -> Array:
        """Standard deviates (k, 3) of the next windows: of new pushes, or correlated with those of their pushes."""
        fresh, change, persistent = self._normals(rows).transpose(1, 0, 2)
        new = ~self._goes_on(self.inputs[rows], inputs)[:, None]
        travelled = self.inputs[rows, 0] * self._windows.duration
        decayed = self._persistence.decayed(self._decaying[rows], travelled, change)
        self._decaying[rows] = decaying = np.where(new, change, decayed)
        self._persistent[rows] = persistent = np.where(new, persistent, self._persistent[rows])
        return self._persistence.deviates(persistent, decaying, fresh)

    def _goes_on(self, before: Array, inputs: Array) -> BoolArray:
        """Whether windows (k, 3) go on with the push of those before: the contact is within a tip's radius."""
        rig = self.task.model.model.rig
        apart = np.abs(inputs[:, 1] - before[:, 1])
        return np.asarray(np.minimum(apart, 1.0 - apart) * rig.outline.perimeter <= rig.pusher_radius)

    def _normals(self, rows: IntArray) -> Array:
        """Three times three standard normal deviates for each of k sliders, (k, 3, 3)."""
        for row in rows[self._used[rows] == BLOCK].tolist():
            self.generators[row].standard_normal(out=self._drawn[row])
            self._used[row] = 0
        self._used[rows] += 1
        return np.asarray(self._drawn[rows, self._used[rows] - 1])
