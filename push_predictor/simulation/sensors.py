"""What tracker, robot and force sensor deliver of the truth: ticks of their own, noise, steps, gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.recordings.streams import PoseStream, ScalarStream, WrenchStream
from push_predictor.simulation.changes import Topic
from push_predictor.simulation.timeline import Truth
from push_predictor.types import Array, BoolArray, IntArray

LENGTH_STEP = 2.0**-17  # m, 8 micrometres; binary steps keep recordings small
ANGLE_STEP = 2.0**-13  # rad
FORCE_STEP = 2.0**-8  # N
TORQUE_STEP = 2.0**-13  # N m
STAMP_STEP = 100_000  # ns
TEMPERATURE_STEP = 2.0**-6  # degrees Celsius
TEMPERATURE_RATE = 2.0  # Hz
GAP = (0.03, 0.10)  # s, length of a dropout


@dataclass(frozen=True)
class Sensors:
    """How the rig is measured.

    Rates in Hz (the poses', the wrench's); noise as standard deviations per sample (m, rad, N, N m); force_bias as
    that of a recording; stamp jitter in s; mean time between dropouts of a stream in s, 0 for none.
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
    """How a rig mismeasures, beside its noise.

    clock_offset: s by which the tracker's stamps are late. frame_rotation rad about the world's origin, frame_shift m:
    of the tracker's frame against the robot's. tool_offset: m by which the tip is told beside where it is.
    wrench_bias: N, N, N m on top of the sensor's own. compliance: m/N by which the rod bends out of the robot's sight.
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
    """The motion tracker's stream; epoch is the stamp (ns) of the truth's time zero."""
    time, stamp = _ticks(truth, sensors, sensors.rate, epoch, rng)
    scale = [sensors.tracker_noise, sensors.tracker_noise, sensors.heading_noise]
    true = _misplaced(truth.at(time - faults.clock_offset, "slider"), faults)
    pose = true + scale * rng.standard_normal((len(time), 3))
    heading = wrap_angle(_stepped(pose[:, 2], ANGLE_STEP))
    return PoseStream(
        stamp, _stepped(pose[:, 0], LENGTH_STEP), _stepped(pose[:, 1], LENGTH_STEP), np.zeros(len(time)), heading
    )


def track_pusher(
    truth: Truth, sensors: Sensors, epoch: int, rng: np.random.Generator, faults: Faults = FAULTLESS
) -> PoseStream:
    """The robot's stream of its tip."""
    time, stamp = _ticks(truth, sensors, sensors.rate, epoch, rng)
    tip = _stepped(_told(truth, time, faults) + sensors.tip_noise * rng.standard_normal((len(time), 3)), LENGTH_STEP)
    return PoseStream(stamp, tip[:, 0], tip[:, 1], tip[:, 2], np.zeros(len(time)))


def feel_wrench(
    truth: Truth, sensors: Sensors, epoch: int, rng: np.random.Generator, faults: Faults = FAULTLESS
) -> WrenchStream:
    """The force-torque sensor's stream; its bias is constant over a recording."""
    time, stamp = _ticks(truth, sensors, sensors.wrench_rate, epoch, rng)
    bias = sensors.force_bias * rng.standard_normal(2)
    wrench = truth.at(time, "wrench")
    if faults != FAULTLESS:
        wrench = wrench + np.asarray(faults.wrench_bias)
    force = wrench[:, :2] + bias + sensors.force_noise * rng.standard_normal((len(time), 2))
    torque = wrench[:, 2] + sensors.torque_noise * rng.standard_normal(len(time))
    force = _stepped(force, FORCE_STEP)
    return WrenchStream(stamp, force[:, 0], force[:, 1], _stepped(torque, TORQUE_STEP))


def surface_temperature(truth: Truth, epoch: int, rng: np.random.Generator) -> ScalarStream:
    """A scalar beside the pushes: it drifts slowly about 22 degrees Celsius and does nothing to them."""
    n = int(truth.time[-1] * TEMPERATURE_RATE) + 1
    stamp = epoch + np.arange(n, dtype=np.int64) * int(1e9 / TEMPERATURE_RATE) + int(rng.integers(10**8))
    drift = 22.0 + np.cumsum(rng.normal(0.0, 0.03, n))
    return ScalarStream(stamp, _stepped(drift, TEMPERATURE_STEP))


def record_topic(topic: Topic, truth: Truth, epoch: int, rng: np.random.Generator) -> ScalarStream:
    """The stream of a given scalar over the whole recording."""
    time = np.arange(0.0, truth.time[-1], 1.0 / TEMPERATURE_RATE)
    values = topic.at(time) + topic.noise * rng.standard_normal(len(time))
    return ScalarStream(epoch + np.round(time * 1e9).astype(np.int64), values)


def _misplaced(pose: Array, faults: Faults) -> Array:
    """Poses (n, 3) as a tracker tells them whose frame is turned about the origin, then shifted."""
    if faults == FAULTLESS:
        return pose
    turn = faults.frame_rotation
    return np.column_stack([rotate(pose[:, :2], np.array(turn)) + faults.frame_shift, pose[:, 2] + turn])


def _told(truth: Truth, time: Array, faults: Faults) -> Array:
    """Where the robot says that its tip is, (n, 3)."""
    tip = truth.at(time, "pusher")
    if faults == FAULTLESS:
        return tip
    bent = faults.compliance * truth.at(time, "wrench")[:, :2]
    return tip + np.column_stack([np.asarray(faults.tool_offset) - bent, np.zeros(len(tip))])


def _ticks(truth: Truth, sensors: Sensors, rate: float, epoch: int, rng: np.random.Generator) -> tuple[Array, IntArray]:
    """Sample times (n,) in s and their stamps (n,), strictly increasing, with the dropouts taken out."""
    period = 1.0 / rate
    n = int((truth.time[-1] - period) * rate)
    jitter = np.clip(sensors.jitter * rng.standard_normal(n), -0.4 * period, 0.4 * period)
    time = (np.arange(n) + 0.5 + 0.1 * rng.random()) * period + jitter
    offset = np.round(time * 1e9 / STAMP_STEP).astype(np.int64) * STAMP_STEP
    kept = ~_dropped(time, sensors.dropout_interval, rng)
    return offset[kept] / 1e9, epoch + offset[kept]


def _dropped(time: Array, interval: float, rng: np.random.Generator) -> BoolArray:
    count = rng.poisson(time[-1] / interval) if interval > 0.0 else 0
    start, length = rng.uniform(0.0, time[-1], count), rng.uniform(*GAP, count)
    inside = (time >= start[:, None]) & (time < (start + length)[:, None])
    return np.asarray(np.any(inside, axis=0), dtype=np.bool_)


def _stepped(values: Array, step: float) -> Array:
    return np.asarray(np.round(values / step) * step)
