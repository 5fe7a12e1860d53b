# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bias and weight of a force-torque sensor, estimated from wrenches in free motion.

A sensor without contact measures, along its own axes, force = bias + weight * down and
torque = bias + lever x down, where down is the direction of gravity in its axes. Where this direction does not change,
the weight is part of the bias.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.fields.pose_rows import inverted, turned
from push_predictor.types import Array, BoolArray, IntArray

LEAST_FREE = 1.0  # s
INTERVAL = 0.25  # s; samples closer than this share one error: sensors drift
COVERED = 0.99  # share of the samples that decide about tilt and accuracy: a pose may jump
LEAST_TILT = 0.02  # rad, of the direction of gravity in the sensor's axes, from which the weight is estimated
MOST_SD = 0.1  # N, of the force that is subtracted; a contact begins at this force
SMALLEST_SD = 1e-3, 1e-5  # N, N m: no sensor is more exact
DOWN = np.array([0.0, 0.0, -1.0])


class BiasError(ValueError):
    """The free motion does not determine the bias; the message states what is needed."""


@dataclass(frozen=True, eq=False)
class WrenchBias:
    """What a sensor measures without contact, along its axes, with standard deviations.

    force (3,) N and torque (3,) N m: the bias. weight (N) and lever (3,) N m, weight times the centre of mass from the
    sensor's origin: None where they are part of the bias. seconds of free motion, in a number of intervals.
    """

    force: Array
    force_sd: Array
    torque: Array
    torque_sd: Array
    seconds: float
    intervals: int
    weight: float | None = None
    weight_sd: float | None = None
    lever: Array | None = None

    def to_text(self) -> str:
        """The estimate in words, with standard deviations."""
        weight = "" if self.weight is None else f", weight {self.weight:.4g} ± {self.weight_sd:.2g} N"
        return (
            f"the bias ({_listed(self.force, self.force_sd)}) N, ({_listed(self.torque, self.torque_sd)}) N m{weight}, "
            f"from {self.seconds:.2g} s of free motion in {self.intervals} intervals (± 1 standard deviation)"
        )

    def subtracted_from(self, wrenches: Array, poses: Array | None = None) -> Array:
        """Wrenches (n, 6) along the sensor's axes without bias and weight; poses (n, 7) of these axes in the world."""
        found = wrenches - np.concatenate([self.force, self.torque])
        if self.weight is None or self.lever is None or poses is None:
            return np.asarray(found)
        down = gravity_direction(poses)
        return np.asarray(found - np.hstack([self.weight * down, np.cross(self.lever, down)]))


def _listed(values: Array, sds: Array) -> str:
    return ", ".join(f"{value:.4g} ± {sd:.2g}" for value, sd in zip(values, sds, strict=True))


def gravity_direction(poses: Array) -> Array:
    """The direction of gravity (n, 3) along the axes of frames with poses (n, 7) in the world, whose z is up."""
    return turned(inverted(poses)[:, 3:], np.tile(DOWN, (len(poses), 1)))


def estimate_bias(stamp: IntArray, wrenches: Array, free: BoolArray, poses: Array | None = None) -> WrenchBias:
    """Bias and, where the sensor tilts, weight from wrenches (n, 6) along its axes; free (n,): without contact.

    stamp (n,) in ns; poses (n, 7) of the axes in the world, None if they are the world's. By least squares over means
    of intervals. Raises BiasError if there is too little free motion.
    """
    intervals = _intervals(stamp, free)
    count, seconds = int(intervals.max(initial=-1)) + 1, _seconds(stamp, free)
    if seconds < LEAST_FREE:
        raise BiasError(
            f"the tip is free for {seconds:.2g} s, at least {LEAST_FREE:g} s is needed; lift the tip between pushes"
        )
    down = None if poses is None else gravity_direction(poses)
    if down is not None and _tilt(down) <= LEAST_TILT:
        down = None
    of_interval = None if down is None else _means(down[free], intervals, count)
    values = _means(wrenches[free], intervals, count)
    force, force_covariance = _fitted(_force_design(of_interval, count), values[:, :3], SMALLEST_SD[0])
    torque, torque_covariance = _fitted(_torque_design(of_interval, count), values[:, 3:], SMALLEST_SD[1])
    _check_exact(force_covariance, down, poses)
    force_sd, torque_sd = np.sqrt(np.diag(force_covariance)), np.sqrt(np.diag(torque_covariance))
    bias = WrenchBias(force[:3], force_sd[:3], torque[:3], torque_sd[:3], seconds, count)
    if down is None:
        return bias
    return replace(bias, weight=float(force[3]), weight_sd=float(force_sd[3]), lever=torque[3:])


def with_planar_numbers(wrenches: Array) -> Array:
    """Wrenches (n, 6) along the world's axes with 0 for numbers that a planar sensor does not report."""
    return np.where(np.isfinite(wrenches), wrenches, 0.0)


def _intervals(stamp: IntArray, free: BoolArray) -> IntArray:
    """The number of the interval of each free sample: consecutive samples within INTERVAL of its first one."""
    rows = np.flatnonzero(free)
    run = np.cumsum(np.diff(rows, prepend=rows[:1]) > 1)
    began = stamp[rows][np.unique(run, return_index=True)[1]]
    part = (stamp[rows] - began[run]) // round(INTERVAL / NANOSECOND)
    return np.unique(np.column_stack([run, part]), axis=0, return_inverse=True)[1].reshape(-1)


def _seconds(stamp: IntArray, free: BoolArray) -> float:
    """How long (s) the tip is free: the number of free samples times the median period."""
    period = float(np.median(np.diff(np.unique(stamp)))) if len(stamp) > 1 else 0.0
    return float(np.sum(free)) * period * NANOSECOND


def _means(values: Array, intervals: IntArray, count: int) -> Array:
    """The mean (count, k) of values (n, k) over each interval."""
    sums = np.column_stack([np.bincount(intervals, column, count) for column in values.T])
    return np.asarray(sums / np.bincount(intervals, minlength=count)[:, None])


def _tilt(down: Array) -> float:
    """The angle (rad) between directions (n, 3) and their mean that a share COVERED of them does not exceed."""
    mean = down.mean(axis=0)
    cosine = float(np.quantile(down @ mean, 1.0 - COVERED) / np.linalg.norm(mean))
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def _force_design(down: Array | None, count: int) -> Array:
    """What the parameters (bias, and weight where gravity is known) add to the forces (count, 3)."""
    bias = np.tile(np.eye(3), (count, 1, 1))
    return bias if down is None else np.concatenate([bias, down[:, :, None]], axis=2)


def _torque_design(down: Array | None, count: int) -> Array:
    """What the parameters (bias, and lever where gravity is known) add to the torques (count, 3)."""
    bias = np.tile(np.eye(3), (count, 1, 1))
    if down is None:
        return bias
    return np.concatenate([bias, np.cross(np.eye(3)[None], down[:, None]).transpose(0, 2, 1)], axis=2)


def _fitted(design: Array, values: Array, smallest_sd: float) -> tuple[Array, Array]:
    """Parameters (p,) and their covariance (p, p) from values (k, 3), which are design (k, 3, p) times parameters.

    Each axis has its own noise, which the residuals of an unweighted fit determine.
    """
    number = design.shape[2]
    found = np.linalg.lstsq(design.reshape(-1, number), values.reshape(-1), rcond=None)[0]
    freedom = max(len(values) - number / 3.0, 1.0)
    noise = np.maximum(np.sqrt(np.sum((values - design @ found) ** 2, axis=0) / freedom), smallest_sd)
    scaled = (design / noise[:, None]).reshape(-1, number)
    found = np.linalg.lstsq(scaled, (values / noise).reshape(-1), rcond=None)[0]
    size, direction = np.linalg.eigh(scaled.T @ scaled)
    # A direction that the samples do not determine gets a very large variance.
    return found, np.asarray((direction / np.maximum(size, 1e-12)) @ direction.T)


def _check_exact(covariance: Array, down: Array | None, poses: Array | None) -> None:
    """Raise BiasError if the horizontal force that is subtracted is not known at a share COVERED of the samples."""
    count = 1 if poses is None else len(poses)
    design = _force_design(down, count)
    if poses is not None:
        design = np.stack([turned(poses[:, 3:], column) for column in np.moveaxis(design, 2, 0)], axis=2)
    variance = np.einsum("nij,jk,nik->ni", design[:, :2], covariance, design[:, :2]).max(axis=1)
    largest = float(np.sqrt(np.quantile(variance, COVERED)))
    if largest > MOST_SD:
        raise BiasError(
            f"the force without contact is known to {largest:.2g} N (standard deviation), at most {MOST_SD:g} N is "
            f"accepted; record free motion in the orientations of the pushes"
        )
