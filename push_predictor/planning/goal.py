"""Where a slider is to be brought: a pose and how far from it is near enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import to_body
from push_predictor.types import Array, BoolArray


@dataclass(frozen=True, eq=False)
class Goal:
    """All poses within `distance` m of pose (3: x, y m, heading rad) whose heading is within `turn` rad of it.

    turn None: any heading will do, as for a circle. symmetry: how many headings of a whole turn look the same
    (Outline.rotational_symmetry; 1 where a slider's sides are told apart). Raises RequestError.
    """

    pose: Array
    distance: float
    turn: float | None
    symmetry: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", np.asarray(self.pose, dtype=np.float64))
        if self.pose.shape != (3,) or not np.all(np.isfinite(self.pose)):
            raise RequestError("goal pose", self.pose.tolist(), "three finite numbers x, y in m, heading")
        if not 0.0 < self.distance < np.inf:
            raise RequestError("goal distance", self.distance, "a finite number above 0, in m")
        if self.turn is not None and not 0.0 < self.turn < np.inf:
            raise RequestError("goal turn", self.turn, "a finite number above 0, in rad, or None for any heading")
        if self.symmetry < 1:
            raise RequestError("goal symmetry", self.symmetry, "1 or more; a circle has turn None")

    def left(self, ahead: Array, moved: Array) -> Array:
        """What is left (..., 3) of displacements ahead (..., 3) after displacements moved (..., 3), seen from there.

        All in body frames: x, y in m and the shortest turn, rad.
        """
        return np.concatenate([to_body(ahead[..., :2], moved), self.shortest(ahead[..., 2:] - moved[..., 2:])], axis=-1)

    def ahead(self, sliders: Array) -> Array:
        """The displacement (..., 3) that is left to the goal, in the body frames of sliders (..., 3)."""
        return self.left(self.pose, sliders)

    def shortest(self, turn: Array) -> Array:
        """Turns (any shape, rad) less those that cannot be seen; zero where any heading will do."""
        if self.turn is None:
            return np.zeros_like(turn)
        period = 2.0 * np.pi / self.symmetry
        return np.asarray(turn - period * np.rint(turn / period))

    def reached(self, ahead: Array) -> BoolArray:
        """Whether what is left (..., 3), as `ahead` gives it, is near enough: (...)."""
        near = ahead[..., 0] ** 2 + ahead[..., 1] ** 2 <= self.distance**2
        return near if self.turn is None else near & (np.abs(self.shortest(ahead[..., 2])) <= self.turn)
