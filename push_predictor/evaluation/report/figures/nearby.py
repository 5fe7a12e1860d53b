# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Choose windows to show as examples, and the windows with similar inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.report.maps import arc_length, sector_length
from push_predictor.evaluation.validation import Comparison
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray

NEAR_CONTACT = 0.1  # of a sector's length
NEAR_ANGLE = np.radians(10.0)
NEAR_SPEED = 0.1  # relative
ENOUGH = 5  # neighbours, of at least two pushes, make a window a good example


@dataclass(frozen=True, eq=False)
class Example:
    """A window (row of the table), and the outcomes (m, 3) of windows with similar inputs, of that many pushes.

    The outcomes are shifted by the difference of the predicted means, so that they show the unexplained part only.
    """

    row: int
    nearby: Array
    pushes: int


def examples(outline: Outline, table: PushTable, comparison: Comparison, count: int) -> list[Example]:
    """Choose up to `count` windows of different pushes, spread over contact and angle; prefer those with neighbours."""
    where = _scaled_inputs(outline, table)
    near = [_near(outline, table, where, row) for row in range(len(table))]
    pushes = [len(set(table.push_id[rows].tolist())) for rows in near]
    eligible = np.array([row for row in range(len(table)) if near[row].size >= ENOUGH and pushes[row] > 1])
    pool = eligible if eligible.size else np.arange(len(table))
    chosen = pool[spread_rows(where[pool][:, :2], table.push_id[pool], count)]
    return [Example(int(row), _moved(comparison, int(row), near[row]), pushes[row]) for row in chosen]


def spread_rows(points: Array, push_id: np.ndarray, count: int) -> IntArray:
    """Indices of up to `count` points (n, 2) of different pushes, far from each other, sorted by the second column."""
    span = np.maximum(np.ptp(points, axis=0), 1e-12)
    scaled = (points - points.min(axis=0)) / span
    chosen = [int(np.argmin(np.linalg.norm(scaled - 0.5, axis=1)))]
    while len(chosen) < count:
        distance = np.min(np.linalg.norm(scaled[:, None] - scaled[chosen][None], axis=2), axis=1)
        distance[np.isin(push_id, push_id[chosen])] = -1.0
        if distance.max() < 0.0:
            break
        chosen.append(int(np.argmax(distance)))
    rows = np.array(chosen, dtype=np.int64)
    return rows[np.argsort(points[rows, 1], kind="stable")]


def _scaled_inputs(outline: Outline, table: PushTable) -> Array:
    """Contact (zero on a circle), angle and log speed (n, 3), scaled so that similar windows are at most 1 apart."""
    velocity, contact, angle = table.inputs.T
    along = arc_length(outline, contact) / (NEAR_CONTACT * sector_length(outline))
    if outline.rotational_symmetry == 0:
        along = np.zeros_like(along)
    return np.column_stack([along, angle / NEAR_ANGLE, np.log(velocity) / NEAR_SPEED])


def _near(outline: Outline, table: PushTable, where: Array, row: int) -> IntArray:
    apart = np.abs(where - where[row])
    if outline.semi_axes is not None:  # the arc length of a smooth outline is periodic
        apart[:, 0] = np.minimum(apart[:, 0], 1.0 / NEAR_CONTACT - apart[:, 0])
    same_duration = np.isclose(table.duration, table.duration[row], rtol=NEAR_SPEED)
    like = np.all(apart <= 1.0, axis=1) & same_duration
    like[row] = False
    return np.flatnonzero(like)


def _moved(comparison: Comparison, row: int, rows: IntArray) -> Array:
    return np.asarray(comparison.observed[rows] - comparison.mean[rows] + comparison.mean[row])
