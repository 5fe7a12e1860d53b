# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sensors: stamped samples of a session with latency, noise, wander and faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.foreign import faults as faulty
from benchmarks.foreign.faults import Fault
from benchmarks.foreign.rig import Rig, Sensors
from benchmarks.foreign.session import Session, Track
from benchmarks.support import bags
from benchmarks.support.bags import Samples
from benchmarks.support.plane import Array

LOG_DELAY = 300_000  # ns between a stamp and its arrival at the recorder
SLIDER_HEIGHT = 0.015  # m
MISSED = 0.0005  # share of frames that the tracker misses


@dataclass(frozen=True)
class SensedSession:
    """All streams: slider and pusher as (x, y, z, yaw), wrench as (force, torque), scalars by topic."""

    slider: Samples
    pusher: Samples
    wrench: Samples
    scalars: dict[str, Samples]

    def serialised(self, start: int) -> list[bags.Topic]:
        """The topics of a bag; `start` is the recording's first instant in ns since 1970."""
        bodies = [("/slider/pose", self.slider), ("/pusher/pose", self.pusher)]
        return [
            *(bags.poses(name, of.stamps(start), _short(of)[:, :3], of.values[:, 3], LOG_DELAY) for name, of in bodies),
            bags.wrenches("/pusher/wrench", self.wrench.stamps(start), _short(self.wrench), LOG_DELAY),
            *(bags.scalars(name, of.stamps(start) + LOG_DELAY, of.values) for name, of in self.scalars.items()),
        ]


def _short(samples: Samples) -> Array:
    """Values rounded to single precision, as sensors deliver them."""
    return samples.values.astype(np.float32).astype(np.float64)


def sense(
    rng: np.random.Generator, rig: Rig, session: Session, scalars: dict[str, Track], faults: Sequence[Fault]
) -> SensedSession:
    """Sample a session with the rig's sensors."""
    return SensedSession(
        slider=_slider(rng, rig.sensors, session, faults),
        pusher=_pusher(rng, rig.sensors, session, faults),
        wrench=_wrench(rng, rig.sensors, session, faults),
        scalars={topic: Samples(track.time, track.values) for topic, track in scalars.items()},
    )


def slider_as_tracked(sensors: Sensors, session: Session, faults: Sequence[Fault], time: Array) -> Array:
    """Slider poses at the stamps `time`, with latency and faults but without noise."""
    true_time = time - sensors.tracker_latency - faulty.clock_lag(faults, time)
    return faulty.tracked(faults, time, session.slider.at(true_time))


def _stamps(rng: np.random.Generator, session: Session, rate: float, missed: float = 0.0) -> Array:
    time = (np.arange(int(session.duration * rate)) + rng.random()) / rate
    time = time + rng.uniform(-0.02, 0.02, len(time)) / rate
    return np.asarray(time[session.recorded(time) & (rng.random(len(time)) >= missed)])


def _slider(rng: np.random.Generator, sensors: Sensors, session: Session, faults: Sequence[Fault]) -> Samples:
    time = _stamps(rng, session, sensors.tracker_rate, MISSED)
    pose = slider_as_tracked(sensors, session, faults, time)
    white = rng.standard_normal((len(time), 4)) * ([sensors.tracker_noise] * 3 + [sensors.heading_noise])
    size = np.array([sensors.wander, sensors.wander, sensors.heading_wander])
    pose = pose + size * _wander(rng, time, sensors.wander_time)
    return Samples(time, np.insert(pose, 2, SLIDER_HEIGHT, axis=1) + white)


def _wander(rng: np.random.Generator, time: Array, lasting: float) -> Array:
    """Three slow random signals of unit variance that decorrelate within `lasting` s."""
    knots = np.arange(0.0, time[-1] + lasting, lasting / 2)
    keep = np.exp(-0.5)
    fresh = rng.standard_normal((len(knots), 3))
    for knot in range(1, len(knots)):
        fresh[knot] = keep * fresh[knot - 1] + np.sqrt(1 - keep**2) * fresh[knot]
    return Track(knots, fresh).at(time)


def _pusher(rng: np.random.Generator, sensors: Sensors, session: Session, faults: Sequence[Fault]) -> Samples:
    time = _stamps(rng, session, sensors.pusher_rate)
    tip = faulty.reported(faults, time, session.pusher.at(time))
    tip = tip + sensors.pusher_noise * rng.standard_normal(tip.shape)
    return Samples(time, np.column_stack([tip, np.zeros(len(time))]))


def _wrench(rng: np.random.Generator, sensors: Sensors, session: Session, faults: Sequence[Fault]) -> Samples:
    """The sensor measures what the slider exerts on the tip: the reaction of the force on the slider."""
    time = _stamps(rng, session, sensors.wrench_rate)
    reaction = -session.force.at(time)
    nothing = np.zeros(len(time))
    force = np.column_stack([reaction[:, :2], nothing]) @ sensors.wrench_axes.T
    torque = np.column_stack([nothing, nothing, reaction[:, 2]]) @ sensors.wrench_axes.T
    force = faulty.biased(faults, time, force) + sensors.wrench_noise * rng.standard_normal((len(time), 3))
    torque = torque + sensors.torque_noise * rng.standard_normal((len(time), 3))
    return Samples(time, np.column_stack([force, torque]))
