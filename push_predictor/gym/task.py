# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What an episode is about: the model, the goal, the scene and the start, and what follows from a pose in them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import paired, to_body
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.table_cache import as_served, load_served
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.particles import POSE_COVARIATES
from push_predictor.resources import SHIPPED
from push_predictor.types import Array, BoolArray

AnyModel = TabulatedModel | PushModel | str | os.PathLike[str]
DISTANCE, TURN = 0.005, 0.1  # m, rad: tolerances of a goal that is given as a pose
TABLE = 0.25 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])  # m, unless a table is given
BONUS = 10.0  # for reaching the goal
FLAGS = ("is_success", "touches", "off_table", "in_domain")  # of a window
MOST_DRAWS = 1000  # of a start that is safe


@dataclass(frozen=True, eq=False)
class PushTask:
    """A model, a goal on a scene, and the pose (3,) at which every episode starts, None for random ones."""

    model: TabulatedModel
    goal: Goal
    scene: Scene
    start: Array | None

    def inputs(self, actions: Array) -> Array:
        """Inputs (n, 3: velocity m/s, contact, angle rad) of actions (n, 3: contact, angle, velocity).

        -1 and 1 are the ends of the model's domain; an action beyond them is clipped.
        """
        share = 0.5 + 0.5 * np.clip(actions, -1.0, 1.0)
        (slowest, fastest), (least, most) = self.model.model.input_limits
        velocity, angle = slowest + (fastest - slowest) * share[:, 2], least + (most - least) * share[:, 1]
        return np.column_stack([velocity, share[:, 0] % 1.0, angle])

    def observation(self, sliders: Array) -> Array:
        """Position of the goal (x, y, m) in the frames of sliders (n, 3), cosine and sine of its heading there."""
        turn = self.goal.pose[2] - sliders[:, 2]
        ahead = to_body(self.goal.pose[:2], sliders)
        return np.concatenate([ahead, paired(np.cos(turn), np.sin(turn))], axis=1).astype(np.float32)

    def ends(self, sliders: Array) -> dict[str, BoolArray]:
        """What ends the episodes of sliders (n, 3), (n,) by name: success, an obstacle, or the end of the table."""
        safe, on_table = self.scene.safe(sliders), self.scene.table.depth(sliders[:, :2]) > 0.0
        success = safe & self.goal.reached(self.goal.ahead(sliders))
        return {"is_success": success, "touches": on_table & ~safe, "off_table": ~on_table}

    def reward(self, before: Array, after: Array, success: BoolArray) -> Array:
        """Rewards (n,) of sliders (n, 3) that were pushed: how much nearer they are, and a bonus for success."""
        return np.asarray(self._distance(before) - self._distance(after) + BONUS * success)

    def _distance(self, sliders: Array) -> Array:
        """From the goal, in tolerances (n,): of the position, plus of the heading."""
        ahead = self.goal.ahead(sliders)
        of_position = np.hypot(ahead[:, 0], ahead[:, 1]) / self.goal.distance
        return of_position if self.goal.turn is None else of_position + np.abs(ahead[:, 2]) / self.goal.turn

    def starts(self, generators: Sequence[np.random.Generator]) -> Array:
        """Poses (n, 3) at which episodes may start: the start, else random, each by a generator of its own.

        They are drawn evenly over the table, until they are free. Raises RequestError if that takes too many draws.
        """
        if self.start is not None:
            return np.tile(self.start, (len(generators), 1))
        low, high = self.scene.table.vertices.min(axis=0), self.scene.table.vertices.max(axis=0)
        poses, left = np.empty((len(generators), 3)), np.arange(len(generators))
        for _ in range(MOST_DRAWS):
            shares = np.array([generators[row].random(3) for row in left.tolist()]).reshape(-1, 3)
            poses[left] = np.array([*low, -np.pi]) + shares * np.array([*(high - low), 2.0 * np.pi])
            left = left[~self.free(poses[left])]
            if not len(left):
                return poses
        raise RequestError("table", self.scene.table.vertices.tolist(), "one with room outside of the goal")

    def free(self, sliders: Array) -> BoolArray:
        """Whether no episode ends at sliders (n, 3), (n,)."""
        return np.asarray(~np.any(list(self.ends(sliders).values()), axis=0))


def push_task(
    model: AnyModel = SHIPPED,
    goal: Goal | Sequence[float] | Array = (0.0, 0.0, 0.0),
    obstacles: Sequence[Array] = (),
    table: Array | None = None,
    start: Sequence[float] | Array | None = None,
) -> PushTask:
    """A checked task; see PushEnv for the arguments. Raises RequestError, and ModelFileError for a file."""
    served = _served(model)
    outline = served.model.rig.outline
    wanted = goal if isinstance(goal, Goal) else Goal(goal, DISTANCE, TURN if outline.rotational_symmetry else None)
    scene = Scene(outline, TABLE if table is None else table, obstacles)
    if not scene.safe(wanted.pose[None])[0]:
        raise RequestError("goal", wanted.pose.tolist(), "a pose on the table that touches no obstacle")
    begin = None if start is None else np.asarray(start, dtype=np.float64)
    task = PushTask(served, wanted, scene, begin)
    if begin is not None and not (begin.shape == (3,) and np.isfinite(begin).all() and task.free(begin[None])[0]):
        accepted = "x, y in m and heading in rad, on the table, without touching an obstacle, not at the goal, or None"
        raise RequestError("start", begin.tolist(), accepted)
    return task


def _served(model: AnyModel) -> TabulatedModel:
    """The model with its table. Raises RequestError if it needs more than poses."""
    if isinstance(model, (str, os.PathLike)):
        served = load_served(model)
    else:
        served = model if isinstance(model, TabulatedModel) else as_served(model)
    if missing := sorted(set(served.model.needs) - set(POSE_COVARIATES)):
        accepted = f"one whose covariates have defaults or follow from poses; it needs {', '.join(missing)}"
        raise RequestError("model", served.model.name, accepted)
    return served
