# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The plan of a recording: which pushes are made, and when.

Every push starts clear of the slider, drives on a straight line at constant speed, and travels a given distance
after it first touches. All times are known before the slider is simulated, because the tip is position controlled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.foreign.rig import Rig
from benchmarks.support.plane import Array, BoolArray, IntArray

SPEEDS = (0.01, 0.02, 0.03)  # m/s
SPEED_SHARES = (0.25, 0.45, 0.30)
SHORTEST_PUSH = 0.45  # s, so that fast pushes hold two windows of 0.2 s
TABLE_REACH = 0.08  # m, resets put the slider within this distance of the origin along x and y
CLEARANCE_TIME = {"lift": 0.25, "drive_back": 0.45}  # s, from the end of the hold until the tip is clear
TRANSFER_TIME = {"lift": 0.55, "drive_back": 0.55}  # s, to above (or in line with) the next start
ENTRY_TIME = {"lift": 0.2, "drive_back": 0.45}  # s, down (or in) to the next start


@dataclass(frozen=True)
class PushDistribution:
    """How the operator chooses pushes: speeds in m/s, contacts as fractions of the perimeter, angles in rad."""

    speeds: tuple[float, ...] = SPEEDS
    speed_shares: tuple[float, ...] = SPEED_SHARES
    contacts: tuple[float, float] = (0.0, 1.0)
    angles: tuple[float, float] = (-1.0, 1.0)
    long_rest: float = 0.0  # share of the session by which the recording is paused once in the middle


@dataclass(frozen=True)
class Plan:
    """Pushes of one recording, one row each; lengths in m, times in s from the recording's start.

    `stays` marks pushes that start where the previous one left the slider; `reset_pose` counts for the others.
    """

    speed: Array
    contact: Array
    angle: Array
    travel: Array
    approach: Array
    reset_pose: Array
    stays: BoolArray
    hold: Array
    pause: Array
    unrecorded: Array
    start: Array
    touch: Array
    release: Array

    def __len__(self) -> int:
        return len(self.speed)

    def rows(self, rows: IntArray, start: Array) -> Plan:
        """Some of the pushes, each reset to a pose of `start` before."""
        some = Plan(**{name: values[rows] for name, values in vars(self).items()})
        return replace(some, reset_pose=start, stays=np.zeros(len(rows), bool))


def draw_plan(rng: np.random.Generator, rig: Rig, count: int, distribution: PushDistribution) -> Plan:
    """Draw `count` pushes and lay them out in time."""
    speed = rng.choice(distribution.speeds, count, p=distribution.speed_shares)
    travel = np.maximum(rng.uniform(0.015, 0.04, count), SHORTEST_PUSH * speed)
    approach = np.maximum(rng.uniform(0.002, 0.006, count), 0.12 * speed)
    hold = rng.uniform(0.05, 0.15, count)
    pause = _draw_pauses(rng, count)
    between = CLEARANCE_TIME[rig.retreat] + TRANSFER_TIME[rig.retreat] + ENTRY_TIME[rig.retreat]
    cycle = (approach + travel) / speed + hold + between + pause
    unrecorded = np.zeros(count)
    unrecorded[count // 2] = distribution.long_rest * cycle.sum()
    start = 1.0 + np.concatenate([[0.0], np.cumsum(cycle + unrecorded)[:-1]])
    touch = start + approach / speed
    return Plan(
        speed=speed,
        travel=travel,
        approach=approach,
        reset_pose=_draw_poses(rng, count),
        contact=rng.uniform(*distribution.contacts, count),
        angle=rng.uniform(*distribution.angles, count),
        stays=_draw_consecutive(rng, rig.consecutive_share, count),
        hold=hold,
        pause=pause,
        unrecorded=unrecorded,
        start=start,
        touch=touch,
        release=touch + travel / speed + hold,
    )


def _draw_pauses(rng: np.random.Generator, count: int) -> Array:
    """Pauses between pushes, s: mostly short, a few long."""
    pause = np.minimum(np.exp(rng.normal(np.log(0.3), 0.8, count)), 4.0) + 0.1
    return np.where(rng.random(count) < 0.02, rng.uniform(4, 15, count), pause)


def _draw_poses(rng: np.random.Generator, count: int) -> Array:
    """Poses to which the slider is reset."""
    places = rng.uniform(-TABLE_REACH, TABLE_REACH, (count, 2))
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, count)])


def _draw_consecutive(rng: np.random.Generator, share: float, count: int) -> BoolArray:
    """Mark pushes that follow without a reset, at most two in a row so that the slider stays on the table."""
    stays = rng.random(count) < share
    stays[0] = False
    for row in range(2, count):
        if stays[row - 1] and stays[row - 2]:
            stays[row] = False
    return np.asarray(stays)
