# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated rig for a planner: single pushes on sliders that lie where the last push left them."""

from __future__ import annotations

from dataclasses import replace

from push_predictor.simulation.batches import conditions_of, end_times
from push_predictor.simulation.dynamics import Motion, run
from push_predictor.simulation.pushes import pusher_path
from push_predictor.simulation.spec import PUSHER_RADIUS, SimulationSpec, physics_of
from push_predictor.types import Array

LONGEST_TRAVEL = 0.08  # m of a tip; noise is drawn for this length, so that a seed gives every push the same noise


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
