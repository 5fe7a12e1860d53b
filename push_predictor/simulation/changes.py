"""What may act on pushes beside the plain rig: laws that take the moment of a push and give what it changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class Conditions:
    """What holds while each of n pushes begins.

    row (n,): its row in the plan. values: by name (n,) each; push_index, elapsed_time s, slid_distance m commanded so
    far, dwell_time s since the last contact (0 for the first), approach m before the commanded touch, velocity m/s,
    contact, angle rad, slider_x, slider_y m, slider_heading, push_heading rad, and the recorded topics by their names.
    """

    row: IntArray
    values: Mapping[str, Array] = field(default_factory=dict)

    def take(self, rows: np.ndarray) -> Conditions:
        """The given pushes."""
        return Conditions(self.row[rows], {name: column[rows] for name, column in self.values.items()})


@dataclass(frozen=True, eq=False)
class Moment:
    """n pushes at an instant.

    conditions: under which they began. pose, velocity (n, 3) of the sliders in the world; contact (n,) fraction of the
    perimeter nearest to the tip; way (n,) m that the tips have gone since their start.
    """

    conditions: Conditions
    pose: Array
    velocity: Array
    contact: Array
    way: Array


Law = Callable[[Moment], Array]


@dataclass(frozen=True)
class Changes:
    """What differs from the plain rig; None: nothing.

    contact_friction (n,): added to the rod's coefficient. load (n, k): added to the logarithms of the loads on the
    support points, whose sum stays the weight. grip (n,): factor on the table's friction. grain (n, 2): anisotropy
    (a, b) of the table's friction in world axes; the friction of a sliding point lies on the ellipse f' W f = grip^2,
    W = [[1 + a, b], [b, 1 - a]], and resists with the largest dissipation. viscosity (n,): drag in N s/m, shared like
    the weight. pull (n, 3): force in N and torque in N m on the slider. added_mass: kg on the slider's centre.
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
    """A scalar that is recorded beside the pushes: value (m,) at time (m,) s, linear between; noise of a sample."""

    time: Array
    value: Array
    noise: float = 0.0

    def at(self, time: Array) -> Array:
        """Its true values at times (n,) s."""
        return np.asarray(np.interp(time, self.time, self.value))
