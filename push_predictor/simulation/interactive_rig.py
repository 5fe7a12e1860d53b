"""Single pushes on sliders that lie where the last push left them: the rig in a planner's hands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.simulation.batches import conditions_of, end_times
from push_predictor.simulation.dynamics import run
from push_predictor.simulation.pushes import pusher_path
from push_predictor.simulation.spec import PUSHER_RADIUS, SimulationSpec, physics_of
from push_predictor.types import Array

LONGEST = 0.08  # m a tip may go: scatter is drawn along so much way, so that a seed means the same for every push


def push_once(spec: SimulationSpec, sliders: Array) -> Array:
    """Poses (n, 3: x, y m, heading rad) of sliders (n, 3) at rest after the n pushes of a spec, one on each.

    The table is that of the spec's surface_seed; what differs from push to push comes from its seed and the row: the
    same seed scatters push k alike, whatever push it is. Raises RigError for an unknown shape or surface, RequestError
    for a way longer than LONGEST.
    """
    path = pusher_path(spec.pushes, spec.slider.outline, PUSHER_RADIUS, sliders, spec.acceleration)
    end = end_times(path, spec.table.friction)
    physics = replace(physics_of(spec, LONGEST), conditions=conditions_of(spec, sliders, path, end))
    return np.asarray(run(physics, path, sliders, end).slider[:, -1])
