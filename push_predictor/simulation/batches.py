# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Run the pushes of a spec in lockstep.

Each push starts from a slider at rest, so the pushes are independent.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.simulation.changes import Conditions
from push_predictor.simulation.dynamics import Motion, run, steps_of
from push_predictor.simulation.physics import GRAVITY
from push_predictor.simulation.pushes import HOLD, PusherPath, pusher_path
from push_predictor.simulation.spec import PUSHER_RADIUS, SimulationSpec, physics_of, start_poses
from push_predictor.simulation.timeline import LOWER_TIME, RESET_TIME
from push_predictor.types import Array, IntArray

LOCKSTEP = 256  # pushes whose arrays fit into the cache
SETTLE = 0.03  # s at rest after each push


@dataclass(frozen=True, eq=False)
class Batch:
    """n pushes simulated together.

    rows (n,) of the plan, motion, path of the tips, end (n,) of each push in s.
    """

    rows: IntArray
    motion: Motion
    path: PusherPath
    end: Array


def run_pushes(spec: SimulationSpec) -> Iterator[Batch]:
    """Simulate all pushes of a spec. Raises RigError for an unknown shape or surface."""
    start = start_poses(spec)
    path = pusher_path(spec.pushes, spec.slider.outline, PUSHER_RADIUS, start, spec.acceleration)
    end = end_times(path, spec.table.friction)
    conditions = conditions_of(spec, start, path, end)
    physics = replace(physics_of(spec, float(np.max(path.length))), conditions=conditions)
    order = np.argsort(end / steps_of(path), kind="stable")
    for rows in np.split(order, range(LOCKSTEP, len(order), LOCKSTEP)):
        lines = path.take(rows)
        yield Batch(rows, run(physics.take(rows), lines, start[rows], end[rows]), lines, end[rows])


def end_times(path: PusherPath, friction: float) -> Array:
    """End times (n,) of pushes, s: the tip has retracted and a slider that slid off has stopped."""
    return np.asarray(path.total_time + SETTLE + path.speed / (0.7 * friction * GRAVITY))


def conditions_of(spec: SimulationSpec, start: Array, path: PusherPath, end: Array) -> Conditions:
    """The conditions at the start of each push.

    start (n, 3): poses of the sliders; path of the tips; end (n,) s: end times.
    """
    plan, n = spec.pushes, len(spec.pushes)
    pause = np.zeros(n) if spec.pauses is None else spec.pauses
    between = pause + RESET_TIME + 2.0 * LOWER_TIME
    begin = np.cumsum(between) + np.concatenate([[0.0], np.cumsum(end)[:-1]]) - LOWER_TIME
    approach = path.length - plan.travel
    after_contact = np.concatenate([[0.0], (end - path.push_time - HOLD)[:-1]])
    values = {
        "push_index": np.arange(n, dtype=np.float64),
        "elapsed_time": begin,
        "slid_distance": np.cumsum(plan.travel) - plan.travel,
        "dwell_time": np.where(np.arange(n) > 0, after_contact + between + approach / plan.speed, 0.0),
        "approach": approach,
        "velocity": plan.speed,
        "contact": plan.contact,
        "angle": plan.angle,
        "slider_x": start[:, 0],
        "slider_y": start[:, 1],
        "slider_heading": start[:, 2],
        "push_heading": np.arctan2(path.direction[:, 1], path.direction[:, 0]),
    }
    topics = {name: topic.at(begin) for name, topic in spec.topics.items()}
    return Conditions(np.arange(n), {**values, **topics})
