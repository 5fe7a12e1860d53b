# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a sequence of pushes is to achieve: a pose with tolerances, or a part of the slider over the table's edge."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.convex import ConvexPolygon
from push_predictor.geometry.frames import rotate
from push_predictor.planning.goal import Goal
from push_predictor.types import Array, BoolArray


class Target(Protocol):
    """A set of poses of the slider."""

    def __hash__(self) -> int: ...

    @property
    def symmetry(self) -> int:
        """Number of equivalent headings in a full turn; 0 if any heading is accepted."""

    def reached(self, poses: Array) -> BoolArray:
        """Whether poses (..., 3) are in the set, (...)."""

    def remaining(self, poses: Array) -> tuple[Array, Array]:
        """Distance in m and rotation in rad, each (...), from poses (..., 3) to the middle of the set."""


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """The poses within the tolerances of a goal."""

    goal: Goal

    @property
    def symmetry(self) -> int:
        """That of the goal; 0 if it accepts any heading."""
        return 0 if self.goal.turn is None else self.goal.symmetry

    def reached(self, poses: Array) -> BoolArray:
        """Whether poses (..., 3) are within the tolerances."""
        return self.goal.reached(self.goal.ahead(poses))

    def remaining(self, poses: Array) -> tuple[Array, Array]:
        """Distance (m) and shortest rotation (rad) to the goal's pose."""
        ahead = self.goal.ahead(poses)
        return np.hypot(ahead[..., 0], ahead[..., 1]), np.abs(ahead[..., 2])


@dataclass(frozen=True, eq=False)
class Overhang:
    """The poses in which a part of the slider hangs over an edge of the table, as for a grasp from below.

    body: the slider's convex outline (Scene.body). edge: index of the table's edge. least: m by which the outline
    passes the edge. heading, turn: of the slider, within rad; symmetry: number of equivalent headings. along: m along
    the edge from its start, where the slider's centre has to be. Raises RequestError.
    """

    body: ConvexPolygon
    table: ConvexPolygon
    edge: int
    least: float
    heading: float
    turn: float
    along: tuple[float, float]
    symmetry: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.edge < len(self.table.vertices):
            raise RequestError("edge", self.edge, f"a number from 0 to {len(self.table.vertices) - 1}")
        if not 0.0 < self.least < self._reach:
            raise RequestError("least", self.least, f"an overhang above 0 m and below {self._reach:.4g} m")
        if not 0.0 < self.turn < np.inf:
            raise RequestError("turn", self.turn, "a finite number above 0, in rad")
        if not self.along[0] < self.along[1]:
            raise RequestError("along", self.along, "two increasing numbers, in m")
        if self.symmetry < 1:
            raise RequestError("symmetry", self.symmetry, "1 or more")

    def reached(self, poses: Array) -> BoolArray:
        """Whether the outline at poses (..., 3) hangs over the edge far enough, with the centre over the table."""
        along, inside = self._place(poses)
        ahead = rotate(self._normal, -poses[..., 2])
        reach = (ahead @ self.body.vertices.T).max(axis=-1)
        enough = (inside > 0.0) & (reach - inside >= self.least)
        aligned = np.abs(self._turned(poses)) <= self.turn
        return np.asarray(enough & aligned & (along >= self.along[0]) & (along <= self.along[1]))

    def remaining(self, poses: Array) -> tuple[Array, Array]:
        """Distance (m) to the middle of the accepted depths, within `along`, and rotation (rad) to the heading."""
        along, inside = self._place(poses)
        aside = np.maximum(np.maximum(self.along[0] - along, along - self.along[1]), 0.0)
        return np.hypot(aside, inside - 0.5 * (self._reach - self.least)), np.abs(self._turned(poses))

    def _place(self, poses: Array) -> tuple[Array, Array]:
        """Place of the centre along the edge and its distance inside it, each (...) in m."""
        from_start = poses[..., :2] - self.table.vertices[self.edge]
        normal = self._normal
        return from_start @ np.array([-normal[1], normal[0]]), -(from_start @ normal)

    def _turned(self, poses: Array) -> Array:
        period = 2.0 * np.pi / self.symmetry
        turned = poses[..., 2] - self.heading
        return np.asarray(turned - period * np.rint(turned / period))

    @property
    def _normal(self) -> Array:
        return np.asarray(self.table.normals[self.edge])

    @cached_property
    def _reach(self) -> float:
        """Distance in m from the centre to the outline's farthest point across the edge, at the heading."""
        return float((self.body.vertices @ rotate(self._normal, np.array(-self.heading))).max())
