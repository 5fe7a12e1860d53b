# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The number of pushes that a slider still needs: shortest paths over poses, around the obstacles of a scene.

A grid of poses (x, y, heading) over the table is searched once from the target outwards. A step between neighbours
costs its share of the longest push, or of the push that turns most. A cell in which the slider is not safe costs
BLOCKED times more instead of being closed, so that a gate narrower than a cell stays open. The grid costs only guide
the search; whether a push is safe is decided with its exact pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import Target
from push_predictor.types import Array, BoolArray, IntArray

CELL = 0.01  # m
TURN = 0.14  # rad
BLOCKED = 10.0
MOST_CELLS = 200_000  # cells grow until no more are needed
# Steps to half of the neighbours; the other half is reached backwards.
STEPS = ((1, 0, 0), (0, 1, 0), (1, 1, 0), (1, -1, 0), (0, 0, 1))


@dataclass(frozen=True, eq=False)
class CostToGo:
    """Costs (X, Y, H) in pushes of the poses low + (i, j, k) * cell; periodic in the heading."""

    costs: Array
    low: Array
    cell: Array
    target: Target
    longest: float
    widest: float

    def at(self, poses: Array) -> Array:
        """Estimated number of pushes (...) from poses (..., 3) to the target, at least that of a straight way."""
        place = (poses.reshape(-1, 3) - self.low) / self.cell
        place[:, 2] %= self.costs.shape[2]
        extended = np.concatenate([self.costs, self.costs[..., :1]], axis=2)
        around = map_coordinates(extended, place.T, order=1, mode="nearest").reshape(poses.shape[:-1])
        distance, turn = self.target.remaining(poses)
        return np.asarray(np.maximum(around, distance / self.longest + turn / self.widest))


def cost_to_go(scene: Scene, target: Target, longest: float, widest: float) -> CostToGo:
    """Search the poses of a scene from the target; longest (m), widest (rad): of a push."""
    symmetry = target.symmetry or scene.outline.rotational_symmetry
    period = 2.0 * np.pi / max(symmetry, 1)
    low, high = scene.table.vertices.min(axis=0), scene.table.vertices.max(axis=0)
    headings = 1 if symmetry == 0 else max(4, round(period / TURN))
    size = max(CELL, float(np.sqrt(np.prod(high - low) * headings / MOST_CELLS)))
    across, along = (np.ceil((high - low) / size).astype(int) + 1).tolist()
    shape = (across, along, headings)
    cell = np.array([size, size, period / headings])
    origin = np.append(low, 0.0)
    poses = origin + np.moveaxis(np.indices(shape), 0, -1) * cell
    steps = _graph(shape, scene.safe(poses), cell / np.array([longest, longest, widest]))
    costs = dijkstra(steps, directed=False, indices=_sources(poses, target, cell), min_only=True)
    return CostToGo(costs.reshape(shape), origin, cell, target, longest, widest)


def _sources(poses: Array, target: Target, cell: Array) -> IntArray:
    """Cells of the target, or the one nearest to it."""
    distance, turn = (values.ravel() for values in target.remaining(poses))
    inside = target.reached(poses.reshape(-1, 3))
    nearest = np.argmin(distance / cell[0] + turn / cell[2])
    return np.union1d(np.flatnonzero(inside), nearest)


def _graph(shape: tuple[int, int, int], safe: BoolArray, cost: Array) -> csr_array:
    """Costs of the steps between neighbours."""
    number, factor = np.arange(np.prod(shape)).reshape(shape), np.where(safe, 1.0, BLOCKED)
    rows, columns, weights = [], [], []
    for step in STEPS:
        i, j, k = step
        if k and shape[2] == 1:
            continue
        here = (slice(0, shape[0] - i), slice(max(0, -j), shape[1] - max(0, j)))
        there = (slice(i, None), slice(max(0, j), shape[1] + min(0, j)))
        rows.append(number[here].ravel())
        columns.append(np.roll(number, -k, axis=2)[there].ravel())
        mean = 0.5 * (factor[here] + np.roll(factor, -k, axis=2)[there])
        weights.append((np.linalg.norm(cost * step) * mean).ravel())
    joined = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(weights), joined), shape=(number.size, number.size)).tocsr()
