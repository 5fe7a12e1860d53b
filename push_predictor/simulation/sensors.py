# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sensor models of tracker, robot and force sensor: sampling, noise, quantisation, dropouts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.recordings.streams import PoseStream, ScalarStream, WrenchStream
from push_predictor.simulation.changes import Topic
from push_predictor.simulation.timeline import Truth
from push_predictor.types import Array, BoolArray, IntArray

LENGTH_STEP = 2.0**-17  # m, 8 micrometres; powers of two compress well
ANGLE_STEP = 2.0**-13  # rad
FORCE_STEP = 2.0**-8  # N
TORQUE_STEP = 2.0**-13  # N m
STAMP_STEP = 100_000  # ns
TEMPERATURE_STEP = 2.0**-6  # degrees Celsius
TEMPERATURE_RATE = 2.0  # Hz
DROPOUT_LENGTHS = (0.03, 0.10)  # s, shortest and longest


@dataclass(frozen=True)
class Sensors:
    """Sampling and noise of the sensors.

    rate, wrench_rate: Hz of the poses and of the wrench. Noise: standard deviations per sample (m, rad, N, N m);
    force_bias: standard deviation per recording. jitter: of the stamps, s. dropout_interval: mean time between the
    dropouts of a stream, s; 0 for none.
    """

    rate: float = 100.0
    wrench_rate: float = 100.0
    tracker_noise: float = 3e-5
    heading_noise: float = 3e-4
    tip_noise: float = 5e-6
    force_noise: float = 0.02
    force_bias: float = 0.02
    torque_noise: float = 2e-4
    jitter: float = 2e-4
    dropout_interval: float = 60.0


@dataclass(frozen=True)
class Faults:
    """Systematic measurement errors, in addition to noise.

    clock_offset: delay of the tracker's stamps, s. frame_rotation (rad, about the world's origin) and frame_shift (m):
    of the tracker's frame relative to the robot's. tool_offset: error of the reported tip position, m. wrench_bias: N,
    N, N m in addition to force_bias. compliance: bending of the rod, m/N, that the robot does not measure.
    """

    clock_offset: float = 0.0
    frame_rotation: float = 0.0
    frame_shift: tuple[float, float] = (0.0, 0.0)
    tool_offset: tuple[float, float] = (0.0, 0.0)
    wrench_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    compliance: float = 0.0


FAULTLESS = Faults()


def track_slider(
    truth: Truth, sensors: Sensors, epoch: int, rng: np.random.Generator, faults: Faults = FAULTLESS
) -> PoseStream:
    """The stream of the motion tracker; epoch is the stamp (ns) of time zero."""
    time, stamp = _ticks(truth, sensors, sensors.rate, epoch, rng)
    scale = [sensors.tracker_noise, sensors.tracker_noise, sensors.heading_noise]
    true = _in_tracker_frame(truth.at(time - faults.clock_offset, "slider"), faults)
    pose = true + scale * rng.standard_normal((len(time), 3))
    heading = wrap_angle(_quantised(pose[:, 2], ANGLE_STEP))
    return PoseStream(
        stamp, _quantised(pose[:, 0], LENGTH_STEP), _quantised(pose[:, 1], LENGTH_STEP), np.zeros(len(time)), heading
    )


def track_pusher(
    truth: Truth, sensors: Sensors, epoch: int, rng: np.random.Generator, faults: Faults = FAULTLESS
) -> PoseStream:
    """The stream of the tip as the robot reports it."""
    time, stamp = _ticks(truth, sensors, sensors.rate, epoch, rng)
    noise = sensors.tip_noise * rng.standard_normal((len(time), 3))
    tip = _quantised(_reported_tip(truth, time, faults) + noise, LENGTH_STEP)
    return PoseStream(stamp, tip[:, 0], tip[:, 1], tip[:, 2], np.zeros(len(time)))


def feel_wrench(
    truth: Truth, sensors: Sensors, epoch: int, rng: np.random.Generator, faults: Faults = FAULTLESS
) -> WrenchStream:
    """The stream of the force-torque sensor; its bias is constant within a recording."""
    time, stamp = _ticks(truth, sensors, sensors.wrench_rate, epoch, rng)
    bias = sensors.force_bias * rng.standard_normal(2)
    wrench = truth.at(time, "wrench") + np.asarray(faults.wrench_bias)
    force = wrench[:, :2] + bias + sensors.force_noise * rng.standard_normal((len(time), 2))
    torque = wrench[:, 2] + sensors.torque_noise * rng.standard_normal(len(time))
    force = _quantised(force, FORCE_STEP)
    return WrenchStream(stamp, force[:, 0], force[:, 1], _quantised(torque, TORQUE_STEP))


def surface_temperature(truth: Truth, epoch: int, rng: np.random.Generator) -> ScalarStream:
    """A slowly drifting temperature of about 22 degrees Celsius, without effect on the pushes."""
    n = int(truth.time[-1] * TEMPERATURE_RATE) + 1
    stamp = epoch + np.arange(n, dtype=np.int64) * int(1e9 / TEMPERATURE_RATE) + int(rng.integers(10**8))
    drift = 22.0 + np.cumsum(rng.normal(0.0, 0.03, n))
    return ScalarStream(stamp, _quantised(drift, TEMPERATURE_STEP))


def record_topic(topic: Topic, truth: Truth, epoch: int, rng: np.random.Generator) -> ScalarStream:
    """The stream of a topic over the whole recording."""
    time = np.arange(0.0, truth.time[-1], 1.0 / TEMPERATURE_RATE)
    values = topic.at(time) + topic.noise * rng.standard_normal(len(time))
    return ScalarStream(epoch + np.round(time * 1e9).astype(np.int64), values)


def _in_tracker_frame(pose: Array, faults: Faults) -> Array:
    """Poses (n, 3) reported in a frame that is rotated about the origin, then shifted."""
    turn = faults.frame_rotation
    return np.column_stack([rotate(pose[:, :2], np.array(turn)) + faults.frame_shift, pose[:, 2] + turn])


def _reported_tip(truth: Truth, time: Array, faults: Faults) -> Array:
    """Tip positions (n, 3) as the robot reports them."""
    tip = truth.at(time, "pusher")
    bent = faults.compliance * truth.at(time, "wrench")[:, :2]
    return tip + np.column_stack([np.asarray(faults.tool_offset) - bent, np.zeros(len(tip))])


def _ticks(truth: Truth, sensors: Sensors, rate: float, epoch: int, rng: np.random.Generator) -> tuple[Array, IntArray]:
    """Sample times (n,) in s and stamps (n,) in ns, strictly increasing, without the samples in dropouts."""
    period = 1.0 / rate
    n = int((truth.time[-1] - period) * rate)
    jitter = np.clip(sensors.jitter * rng.standard_normal(n), -0.4 * period, 0.4 * period)
    time = (np.arange(n) + 0.5 + 0.1 * rng.random()) * period + jitter
    offset = np.round(time * 1e9 / STAMP_STEP).astype(np.int64) * STAMP_STEP
    kept = ~_dropped(time, sensors.dropout_interval, rng)
    return offset[kept] / 1e9, epoch + offset[kept]


def _dropped(time: Array, interval: float, rng: np.random.Generator) -> BoolArray:
    count = rng.poisson(time[-1] / interval) if interval > 0.0 else 0
    start, length = rng.uniform(0.0, time[-1], count), rng.uniform(*DROPOUT_LENGTHS, count)
    inside = (time >= start[:, None]) & (time < (start + length)[:, None])
    return np.asarray(np.any(inside, axis=0), dtype=np.bool_)


def _quantised(values: Array, step: float) -> Array:
    return np.asarray(np.round(values / step) * step)
