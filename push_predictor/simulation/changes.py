# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Effects that act on pushes in addition to the plain rig, as functions of the state during a push."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class Conditions:
    """The conditions at the start of n pushes.

    row (n,): row of the plan. values: by name (n,) each. They are push_index, elapsed_time s, slid_distance m commanded
    so far, dwell_time s since the last contact (0 for the first), approach m before the commanded touch, velocity m/s,
    contact, angle rad, slider_x, slider_y m, slider_heading, push_heading rad, and the recorded topics by name.
    """

    row: IntArray
    values: Mapping[str, Array] = field(default_factory=dict)

    def take(self, rows: np.ndarray) -> Conditions:
        """The given pushes."""
        return Conditions(self.row[rows], {name: column[rows] for name, column in self.values.items()})


@dataclass(frozen=True, eq=False)
class Moment:
    """n pushes at an instant.

    conditions: those at their start. pose, velocity (n, 3) of the sliders in the world; contact (n,): fraction of the
    perimeter nearest to the tip; travelled (n,) m: path length of the tips since their start.
    """

    conditions: Conditions
    pose: Array
    velocity: Array
    contact: Array
    travelled: Array


Law = Callable[[Moment], Array]


@dataclass(frozen=True)
class Changes:
    """Differences from the plain rig; None means no difference.

    contact_friction (n,): added to the coefficient at the rod. load (n, k): added to the logarithms of the loads on
    the support points; their sum remains the weight. grip (n,): factor on the table's friction. grain (n, 2):
    anisotropy (a, b) of the table's friction in world axes. The friction of a sliding point lies on the ellipse
    f' W f = grip^2 with W = [[1 + a, b], [b, 1 - a]] and maximises dissipation. viscosity (n,): drag in N s/m,
    distributed like the weight. pull (n, 3): force in N and torque in N m on the slider. added_mass: kg at the
    slider's centre.
    """

    contact_friction: Law | None = None
    load: Law | None = None
    grip: Law | None = None
    grain: Law | None = None
    viscosity: Law | None = None
    pull: Law | None = None
    added_mass: float = 0.0


PLAIN = Changes()


@dataclass(frozen=True, eq=False)
class Topic:
    """A recorded scalar: value (m,) at time (m,) s, linear in between.

    noise: standard deviation per sample.
    """

    time: Array
    value: Array
    noise: float = 0.0

    def at(self, time: Array) -> Array:
        """Its true values at times (n,) s."""
        return np.asarray(np.interp(time, self.time, self.value))
