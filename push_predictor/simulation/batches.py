"""Run the pushes of a spec, many in lockstep: every push starts from a slider at rest, so they do not depend on each
other.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from push_predictor.simulation.dynamics import Motion, run, steps_of
from push_predictor.simulation.physics import GRAVITY
from push_predictor.simulation.pushes import PusherPath, pusher_path
from push_predictor.simulation.spec import PUSHER_RADIUS, SimulationSpec, physics_of, start_poses
from push_predictor.types import Array, IntArray

LOCKSTEP = 256  # pushes; their arrays stay in the cache
SETTLE = 0.03  # s at rest after each push


@dataclass(frozen=True, eq=False)
class Batch:
    """Pushes that ran together: their rows (n,) in the plan, their motion, the tips' paths, their ends (n,) in s."""

    rows: IntArray
    motion: Motion
    path: PusherPath
    end: Array


def run_pushes(spec: SimulationSpec) -> Iterator[Batch]:
    """Simulate all pushes of a spec. Raises RigError for an unknown shape or surface."""
    start = start_poses(spec)
    path = pusher_path(spec.pushes, spec.slider.outline, PUSHER_RADIUS, start, spec.acceleration)
    physics = physics_of(spec, float(np.max(path.length)))
    end = _end_times(path, spec.table.friction)
    order = np.argsort(end / steps_of(path), kind="stable")
    for rows in np.split(order, range(LOCKSTEP, len(order), LOCKSTEP)):
        lines = path.take(rows)
        yield Batch(rows, run(physics.take(rows), lines, start[rows], end[rows]), lines, end[rows])


def _end_times(path: PusherPath, friction: float) -> Array:
    """When pushes (n,) are over, s: the tip is back and a slider that flew off has come to rest."""
    return np.asarray(path.total_time + SETTLE + path.speed / (0.7 * friction * GRAVITY))
