# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the sensors record of a session: stamps in s from its start, and columns of values."""

from dataclasses import dataclass

import numpy as np

from benchmarks.points_rig.rigs import PUSHER_RADIUS, Rig
from benchmarks.points_rig.scenarios import Fault
from benchmarks.points_rig.sessions import AFTER, BEFORE, Session
from benchmarks.points_rig.simulation import STEP, Tracks
from benchmarks.support import bags
from benchmarks.support.bags import Samples
from benchmarks.support.plane import Array, IntArray, cross, direction, rotate

LATENCY = {"slider": 4_000_000, "tip": 1_000_000, "wrench": 1_500_000}  # ns from stamp to arrival
RATE = 250.0  # Hz, of the tip's pose and of the force sensor
TRACKER_NOISE, HEADING_NOISE = 0.00007, 0.0001  # m, rad
TIP_NOISE, FORCE_NOISE, TORQUE_NOISE = 0.00002, 0.1, 0.002  # m, N, N m
HOLD, RELAXED = 0.1, 0.7  # s the tip rests after a push, and the share of the force that remains meanwhile
LIFT, LIFT_TIME, RETREAT_SPEED = 0.03, 0.1, 0.05  # m, s, m/s


@dataclass(frozen=True)
class Streams:
    """Readings of the slider (x, y, heading), the tip (x, y, z), the force (x, y, torque z) and the topics."""

    slider: Samples
    tip: Samples
    wrench: Samples
    topics: dict[str, Samples]

    def serialised(self, epoch: float) -> list[bags.Topic]:
        """The topics of a bag; `epoch` (s) is the absolute time of the session's start."""
        start = int(epoch) * 1_000_000_000
        slider, tip, (x, y, torque) = self.slider.values, self.tip.values, self.wrench.values.T
        place, level = np.column_stack([slider[:, :2], np.zeros(len(slider))]), np.zeros(len(tip))
        wrench = np.column_stack([x, y, *np.zeros((3, len(x))), torque])
        return [
            bags.poses("/slider/pose", self.slider.stamps(start), place, slider[:, 2], LATENCY["slider"]),
            bags.poses("/pusher/pose", self.tip.stamps(start), tip, level, LATENCY["tip"]),
            bags.wrenches("/pusher/wrench", self.wrench.stamps(start), wrench, LATENCY["wrench"]),
            *(bags.scalars(f"/{name}", of.stamps(start), of.values) for name, of in self.topics.items()),
        ]


@dataclass(frozen=True)
class _Clock:
    """Sample times (S,) in s, the push (S,) each belongs to, and the time since its tip set off (S,)."""

    time: Array
    push: IntArray
    since: Array


def sense(
    random: np.random.Generator, rig: Rig, session: Session, tracks: Tracks, fault: Fault | None = None
) -> Streams:
    """Record a simulated session, with a sensor's fault if there is one."""
    tracker, sensor = _clock(random, session, rig.tracker_rate), _clock(random, session, RATE)
    topics = {name: Samples(session.topic_times, values[:, None]) for name, values in session.topics.items()}
    slider, wrench = _slider(random, session, tracks, tracker), _wrench(random, session, tracks, sensor)
    if fault is not None:
        slider, wrench = _faulty_slider(slider, fault), _faulty_wrench(wrench, fault, session)
    return Streams(slider, _tip(random, rig, session, tracks, sensor), wrench, topics)


def _clock(random: np.random.Generator, session: Session, rate: float) -> _Clock:
    """Regular ticks while the recorder runs: shortly before to shortly after each push."""
    phase = random.random() / rate
    first = np.ceil((session.start - BEFORE - phase) * rate).astype(np.int64)
    last = np.floor((session.stop + AFTER - phase) * rate).astype(np.int64)
    counts = last - first + 1
    push = np.repeat(np.arange(len(session)), counts)
    tick = np.arange(len(push)) - np.repeat(np.cumsum(counts) - counts, counts) + first[push]
    time = tick / rate + phase
    return _Clock(time, push, time - session.start[push])


def _path(session: Session, clock: _Clock) -> Array:
    """Path of the tip (S,) in the push, m."""
    return np.clip(clock.since * session.speed[clock.push], 0.0, session.length[clock.push])


def _rest(session: Session, clock: _Clock) -> Array:
    """Time (S,) since the tip has stopped, s; negative before."""
    return clock.since - (session.length / session.speed)[clock.push]


def _slider(random: np.random.Generator, session: Session, tracks: Tracks, clock: _Clock) -> Samples:
    pose = tracks.at(clock.push, _path(session, clock))
    noise = random.normal(0.0, 1.0, pose.shape) * [TRACKER_NOISE, TRACKER_NOISE, HEADING_NOISE]
    return Samples(clock.time, pose + noise)


def _tip(random: np.random.Generator, rig: Rig, session: Session, tracks: Tracks, clock: _Clock) -> Samples:
    path, retreat = _path(session, clock), np.maximum(_rest(session, clock) - HOLD, 0.0)
    height = np.zeros(len(path))
    if rig.lifts:
        lowering = np.clip((-clock.since - 0.3 * BEFORE) / LIFT_TIME, 0.0, 1.0)
        height = LIFT * np.maximum(lowering, np.clip(retreat / LIFT_TIME, 0.0, 1.0))
    else:
        path = path - RETREAT_SPEED * retreat
    place = tracks.origin[clock.push] + path[:, None] * direction(tracks.heading[clock.push])
    values = np.column_stack([place, height])
    return Samples(clock.time, values + random.normal(0.0, TIP_NOISE, values.shape))


def _wrench(random: np.random.Generator, session: Session, tracks: Tracks, clock: _Clock) -> Samples:
    """Force of the slider on the tip, world axes, and the torque about the tip's centre."""
    rest = _rest(session, clock)
    inside = np.maximum(_path(session, clock) - 1e-9, 0.0)
    step = (inside / STEP).astype(np.int64)
    share = np.where(clock.since < 0, 0.0, np.where(rest < 0, 1.0, np.where(rest < HOLD, RELAXED, 0.0)))
    force = share[:, None] * tracks.force[step, clock.push]
    torque = PUSHER_RADIUS * cross(tracks.normal[step, clock.push], force)
    noise = random.normal(0.0, 1.0, (len(step), 3)) * [FORCE_NOISE, FORCE_NOISE, TORQUE_NOISE]
    return Samples(clock.time, np.column_stack([force, torque]) + noise)


def _faulty_slider(slider: Samples, fault: Fault) -> Samples:
    place, heading = slider.values[:, :2], slider.values[:, 2]
    match fault.kind:
        case "clock_offset":
            return Samples(slider.time + fault.value, slider.values)
        case "frame_rotation":
            turned = rotate(place, np.full(len(place), fault.value))
            return Samples(slider.time, np.column_stack([turned, heading + fault.value]))
        case "frame_shift":
            return Samples(slider.time, np.column_stack([place + fault.value * direction(fault.angle), heading]))
    return slider


def _faulty_wrench(wrench: Samples, fault: Fault, session: Session) -> Samples:
    if fault.kind != "wrench_bias":
        return wrench
    begin = session.start[0] + fault.begin * (session.start[-1] - session.start[0]) if fault.begin > 0 else 0.0
    bias = fault.value * np.append(direction(fault.angle), 0.0)
    return Samples(wrench.time, wrench.values + bias * (wrench.time >= begin)[:, None])
