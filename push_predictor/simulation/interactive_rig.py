# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated rig for planners and controllers: single pushes, or tips that stay in contact and are pushed on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.geometry.frames import paired, to_world
from push_predictor.simulation.batches import conditions_of, end_times
from push_predictor.simulation.dynamics import LONGEST_STEP, TRAVEL_STEP, Motion, run
from push_predictor.simulation.pushes import PusherPath, PushPlan, pusher_path
from push_predictor.simulation.spec import PUSHER_RADIUS, SimulationSpec, physics_of
from push_predictor.types import Array, IntArray

LONGEST_TRAVEL = 0.08  # m of a tip; noise is drawn for this length, so that a seed gives every push the same noise
REST = 0.1  # s in which a slider stops that its tip no longer pushes
PLACEMENTS = 40  # of a tip with noise of their own; after these it repeats


def push_once(spec: SimulationSpec, sliders: Array) -> Array:
    """Poses (n, 3: x, y m, heading rad) of sliders (n, 3) after one push of a spec on each.

    The sliders are at rest before and after. surface_seed of the spec draws the table. Its seed and the row draw the
    noise of a push: with the same seed, push k gets the same noise for any commands. The noise stays constant beyond
    LONGEST_TRAVEL. Raises RigError for an unknown shape or surface.
    """
    return push_motion(spec, sliders).slider[:, -1].copy()


def push_motion(spec: SimulationSpec, sliders: Array) -> Motion:
    """The whole motion of the pushes of `push_once`."""
    path = pusher_path(spec.pushes, spec.slider.outline, PUSHER_RADIUS, sliders, spec.acceleration)
    end = end_times(path, spec.table.friction)
    physics = replace(physics_of(spec, LONGEST_TRAVEL), conditions=conditions_of(spec, sliders, path, end))
    return run(physics, path, sliders, end)


class LiveRig:
    """n sliders, each with a tip; sliders (n, 3: x, y m, heading rad) and tips (n, 2) m are where they are now.

    spec: shape, surface, seeds, contact friction and changes; changes may depend on the state, not on the conditions of
    a push. Its pushes are not used. The noise depends on the seed, the row, and how often the tip was placed; it goes
    on while the tip pushes and stays constant beyond LONGEST_TRAVEL. Raises RigError for an unknown shape or surface.
    """

    def __init__(self, spec: SimulationSpec, sliders: Array) -> None:
        self.sliders, self.tips = np.array(sliders, dtype=np.float64), np.full((len(sliders), 2), np.nan)
        self.placed = np.zeros(len(sliders), dtype=np.int64)  # number of placements so far
        self._velocity, self._travelled = np.zeros_like(self.sliders), np.zeros(len(sliders))
        self.outline = spec.slider.outline
        unused = PushPlan(*np.full((4, len(sliders) * PLACEMENTS), 0.1))
        self._physics = physics_of(replace(spec, pushes=unused), LONGEST_TRAVEL)

    def place(self, rows: IntArray, contacts: Array) -> None:
        """Stop the tips of rows (k,), then put them at contacts (k,), modulo 1, of their sliders, which rest."""
        self.stop(rows)
        contacts = contacts % 1.0
        touch = self.outline.point(contacts) - PUSHER_RADIUS * self.outline.inward_normal(contacts)
        self.tips[rows], self._travelled[rows] = to_world(touch, self.sliders[rows]), 0.0
        self.placed[rows] += 1

    def push(self, rows: IntArray, speeds: Array, headings: Array, duration: float) -> None:
        """Move the placed tips of rows (k,) at speeds (k,) m/s in directions (k,) rad of the world for duration s."""
        direction = paired(np.cos(headings), np.sin(headings))
        steps = int(np.ceil(duration / min(LONGEST_STEP, TRAVEL_STEP / max(speeds.max(), TRAVEL_STEP))))
        time_step, travelled = np.full(len(rows), duration / steps), self._travelled[rows]
        start = self.tips[rows] - travelled[:, None] * direction
        path = _Onward(start, direction, speeds * duration, speeds, np.inf, travelled)
        physics = self._physics.take(rows * PLACEMENTS + (self.placed[rows] - 1) % PLACEMENTS)
        end = (steps - 0.5) * time_step  # half a step early: rounding adds no step
        motion = run(physics, path, self.sliders[rows], end, velocity=self._velocity[rows], time_step=time_step)
        self._velocity[rows] = (motion.slider[:, -1] - motion.slider[:, -2]) / time_step[:, None]
        self.sliders[rows], self.tips[rows] = motion.slider[:, -1], motion.pusher[:, -1]
        self._travelled[rows] += speeds * duration

    def stop(self, rows: IntArray) -> Array:
        """Stop the tips of rows (k,) and wait until their sliders rest, at poses (k, 3)."""
        moving = rows[self._velocity[rows].any(axis=1)]
        if len(moving):
            self.push(moving, np.zeros(len(moving)), np.zeros(len(moving)), REST)
            self._velocity[moving] = 0.0
        return self.sliders[rows]


@dataclass(frozen=True, eq=False)
class _Onward(PusherPath):
    """Straight paths at constant speed of tips that have already travelled (n,) m; start lies as far behind them."""

    travelled: Array

    def position(self, time: Array) -> Array:
        return np.asarray(self.start + (self.travelled + self.speed * time)[..., None] * self.direction)
