# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The goal of a planner: a pose with tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import to_body
from push_predictor.types import Array, BoolArray


@dataclass(frozen=True, eq=False, init=False)
class Goal:
    """All poses within `distance` m and `turn` rad of pose (3: x, y m, heading rad).

    turn None accepts any heading, as for a circle. symmetry: number of equivalent headings in a full turn
    (Outline.rotational_symmetry; 1 if the slider's sides differ). Raises RequestError.
    """

    pose: Array
    distance: float
    turn: float | None
    symmetry: int

    def __init__(
        self, pose: Sequence[float] | Array, distance: float, turn: float | None = None, symmetry: int = 1
    ) -> None:
        values = {"pose": np.asarray(pose, dtype=np.float64), "distance": distance, "turn": turn, "symmetry": symmetry}
        for name, value in values.items():
            object.__setattr__(self, name, value)
        if self.pose.shape != (3,) or not np.all(np.isfinite(self.pose)):
            raise RequestError("goal pose", self.pose.tolist(), "three finite numbers x, y in m, heading in rad")
        if not 0.0 < self.distance < np.inf:
            raise RequestError("goal distance", self.distance, "a finite number above 0, in m")
        if self.turn is not None and not 0.0 < self.turn < np.inf:
            raise RequestError("goal turn", self.turn, "a finite number above 0, in rad, or None for any heading")
        if self.symmetry < 1:
            raise RequestError("goal symmetry", self.symmetry, "1 or more, for a circle turn None")

    def remaining(self, ahead: Array, moved: Array) -> Array:
        """Displacements (..., 3) that remain of ahead (..., 3) after displacements moved (..., 3).

        All in the body frame before the displacement: x, y in m and the shortest rotation in rad.
        """
        return np.concatenate([to_body(ahead[..., :2], moved), self.shortest(ahead[..., 2:] - moved[..., 2:])], axis=-1)

    def ahead(self, sliders: Array) -> Array:
        """Displacements (..., 3) from sliders (..., 3) to the goal, in their body frames."""
        return self.remaining(self.pose, sliders)

    def shortest(self, turn: Array) -> Array:
        """Shortest equivalent rotations (any shape, rad); zero if any heading is accepted."""
        if self.turn is None:
            return np.zeros_like(turn)
        period = 2.0 * np.pi / self.symmetry
        return np.asarray(turn - period * np.rint(turn / period))

    def reached(self, ahead: Array) -> BoolArray:
        """Whether displacements to the goal (..., 3) are within the tolerances, (...)."""
        near = ahead[..., 0] ** 2 + ahead[..., 1] ** 2 <= self.distance**2
        return near if self.turn is None else near & (np.abs(self.shortest(ahead[..., 2])) <= self.turn)

    def errors(self, poses: Array) -> Array:
        """Errors (..., 3) of poses (..., 3) in the world: x, y in m and the shortest rotation in rad, 0 for any."""
        turned = self.shortest(poses[..., 2:] - self.pose[2])
        return np.concatenate([poses[..., :2] - self.pose[:2], turned], axis=-1)

    def likely(self, poses: Array, covariance: Array) -> Array:
        """How likely (...) poses with means (..., 3) and covariance (..., 3, 3) are within the tolerances, smoothly.

        1 at the goal without uncertainty; the tolerances are Gaussian, exp(-1) at their limits. A planner that samples
        needs a slope outside of them. Source: saturating cost, Deisenroth and Rasmussen, PILCO, 2011.
        """
        size = 2 if self.turn is None else 3
        tolerance = np.diag([self.distance, self.distance, self.turn or 0.0][:size]) ** 2 / 2.0
        total, error = covariance[..., :size, :size] + tolerance, self.errors(poses)[..., :size]
        exponent = 0.5 * np.sum(error * np.linalg.solve(total, error[..., None])[..., 0], axis=-1)
        return np.asarray(np.exp(-exponent) * np.sqrt(np.linalg.det(tolerance) / np.linalg.det(total)))
