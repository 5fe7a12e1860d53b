# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Random problems for risk.py: a gate between a square and a region, and a lane to the edge of the table.

The forms are those of the two tasks of ActivePusher (arXiv 2506.04646): push into a region, and push to the table's
edge so that a part of the slider hangs over it, both among obstacles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import Overhang, PoseTarget, Target
from push_predictor.types import Array

TABLE = (-0.25, 0.25, -0.18, 0.18)  # m: x from, to, y from, to
WALL = 0.02  # m, its thickness
START_CLEARANCE = 0.004  # m
HALF = 0.045  # m, of the square's side


@dataclass(frozen=True, eq=False)
class Problem:
    """A slider at start (3,), the scene and the target."""

    start: Array
    scene: Scene
    target: Target


@dataclass(frozen=True)
class Task:
    """Problems of one kind; observed: whether the plan is made again after every push; limit: of pushes."""

    name: str
    observed: bool
    limit: int
    draw: Callable[[np.random.Generator, Outline], Problem]


def problem(task: Task, number: int, outline: Outline) -> Problem:
    """The problem of that number."""
    rng = np.random.default_rng([2026, [known.name for known in TASKS].index(task.name), number])
    while True:
        drawn = task.draw(rng, outline)
        if drawn.scene.clearance(drawn.start) > START_CLEARANCE:
            return drawn


@lru_cache(maxsize=1000)
def inner_target(target: Target, margin: float) -> Target:
    """The target without its rim of that width (m); at least a quarter of its width remains."""
    if margin == 0.0:
        return target
    if isinstance(target, PoseTarget):
        goal = target.goal
        return PoseTarget(Goal(goal.pose, max(goal.distance - margin, 0.25 * goal.distance), goal.turn, goal.symmetry))
    if isinstance(target, Overhang):
        return replace(target, least=target.least + min(margin, 0.375 * (HALF - target.least)))
    raise TypeError(f"no inner target of {type(target).__name__}")


def box(x_from: float, x_to: float, y_from: float, y_to: float) -> Array:
    """Corners (4, 2) of a rectangle in m."""
    return np.array([[x_from, y_from], [x_to, y_from], [x_to, y_to], [x_from, y_to]])


def _gate(
    rng: np.random.Generator, outline: Outline, room: tuple[float, float], far: tuple[float, float], radius: float
) -> Problem:
    """room: clearance of the square on each side, m; far: distance of the start from the wall, m."""
    middle, half = rng.uniform(-0.03, 0.03), HALF + rng.uniform(*room)
    walls = [box(0.0, WALL, TABLE[2], middle - half), box(0.0, WALL, middle + half, TABLE[3])]
    start = np.array([-rng.uniform(*far), middle + rng.uniform(-0.05, 0.05), rng.uniform(-np.pi, np.pi)])
    goal = Goal(np.array([0.10, middle + rng.uniform(-0.03, 0.03), 0.0]), radius)
    return Problem(start, Scene(outline, box(*TABLE), walls), PoseTarget(goal))


def _edge(
    rng: np.random.Generator,
    outline: Outline,
    room: tuple[float, float],
    far: tuple[float, float],
    band: tuple[float, float],
    turn: float,
) -> Problem:
    """room: clearance of the square on each side of the lane, far: distance of the start from the edge, band: depth of
    the accepted places of the centre behind the edge, all in m; turn: accepted heading, rad."""
    middle, half = rng.uniform(-0.03, 0.03), HALF + rng.uniform(*room)
    blocks = [box(0.15, TABLE[1], TABLE[2], middle - half), box(0.15, TABLE[1], middle + half, TABLE[3])]
    scene = Scene(outline, box(*TABLE), blocks)
    along = middle - TABLE[2]
    least = HALF - rng.uniform(*band)
    target = Overhang(scene.body, scene.table, 1, least, 0.0, turn, (along - 0.1, along + 0.1), 4)
    start = np.array([TABLE[1] - rng.uniform(*far), middle + rng.uniform(-0.04, 0.04), rng.uniform(-np.pi, np.pi)])
    return Problem(start, scene, target)


TASKS = (
    Task("gate, replanned", True, 10, lambda rng, outline: _gate(rng, outline, (0.004, 0.016), (0.09, 0.14), 0.02)),
    Task(
        "edge, replanned",
        True,
        10,
        lambda rng, outline: _edge(rng, outline, (0.012, 0.03), (0.17, 0.24), (0.004, 0.01), 0.2),
    ),
    Task("gate, fixed plan", False, 8, lambda rng, outline: _gate(rng, outline, (0.02, 0.06), (0.09, 0.12), 0.04)),
    Task(
        "edge, fixed plan",
        False,
        8,
        lambda rng, outline: _edge(rng, outline, (0.02, 0.05), (0.10, 0.16), (0.012, 0.024), 0.4),
    ),
)
