# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The plan of one recording: where, how and when each push is made, and the scalar topics meanwhile."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from benchmarks.points_rig.rigs import Rig
from benchmarks.support.plane import Array, BoolArray, IntArray

BEFORE, AFTER = 0.15, 0.25  # s recorded before the tip sets off and after it stops
REACH = 0.08  # m, the slider is put back within this distance of the origin on each axis
ANGLE = 0.9  # rad, largest angle between a push and the inward normal
InputShift = Literal["new_speeds", "one_side", "angle_range"]


@dataclass(frozen=True)
class Session:
    """One row a push: lengths in m, speeds in m/s, times in s from the start of the session, angles in rad."""

    contact: Array  # fraction of the perimeter
    angle: Array  # from the inward normal to the direction of the push
    gap: Array  # free approach
    travel: Array  # after touching
    speed: Array
    pose: Array  # (P, 3), where the slider is put
    start: Array  # when the tip sets off
    chained: BoolArray  # the slider is left where the push before moved it
    topic_times: Array  # (T,)
    topics: dict[str, Array]  # name: (T,)

    def __len__(self) -> int:
        """Number of pushes."""
        return len(self.start)

    @property
    def length(self) -> Array:
        """Path of the tip in each push, m."""
        return self.gap + self.travel

    @property
    def stop(self) -> Array:
        """When the tip stops, s."""
        return self.start + self.length / self.speed

    def progress(self, measure: str) -> Array:
        """Share (P,) of the session that has passed at each push, by time, number or distance pushed."""
        by = {"time": self.start, "pushes": np.arange(float(len(self))), "distance": np.cumsum(self.travel)}[measure]
        return np.asarray((by - by[0]) / (by[-1] - by[0]))

    def unchained(self, rows: IntArray) -> "Session":
        """Some of the pushes, each begun where it is planned."""
        per_push = ("contact", "angle", "gap", "travel", "speed", "pose", "start")
        part = {name: getattr(self, name)[rows] for name in per_push}
        return replace(self, **part, chained=np.zeros(len(rows), dtype=np.bool_))

    def topic_levels(self, name: str) -> Array:
        """A scalar topic at each push (P,), centred, in 1.5 standard deviations, at most 1.3."""
        values = self.topics[name]
        level = (np.interp(self.start, self.topic_times, values) - values.mean()) / (1.5 * values.std())
        return np.asarray(np.clip(level, -1.3, 1.3))


def plan_session(
    random: np.random.Generator, rig: Rig, pushes: int, shift: InputShift | None = None, later: bool = False
) -> Session:
    """Draw a session; with `shift`, the later one's pushes differ from the training's."""
    contact, angle, speed = _draw_inputs(random, rig, pushes, shift, later)
    gap, travel = random.uniform(0.002, 0.010, pushes), random.uniform(0.020, 0.045, pushes)
    pauses = random.uniform(2.0, 8.0, pushes)
    pauses[random.integers(pushes, size=int(random.integers(2, 6)))] = random.uniform(50.0, 100.0)
    busy = (gap + travel) / speed + BEFORE + AFTER
    start = 5.0 + np.cumsum(pauses + busy) - busy
    times = np.arange(0.0, start[-1] + 10.0, 1.0 / rig.topic_rate)
    pose = np.column_stack([random.uniform(-REACH, REACH, (pushes, 2)), random.uniform(-np.pi, np.pi, pushes)])
    return Session(
        contact, angle, gap, travel, speed, pose, start,
        chained=np.arange(pushes) % rig.chain != 0,
        topic_times=times,
        topics={name: _wander(random, times, 22.0 + 20.0 * k) for k, name in enumerate(rig.topics)},
    )  # fmt: skip


def _draw_inputs(
    random: np.random.Generator, rig: Rig, pushes: int, shift: InputShift | None, later: bool
) -> tuple[Array, Array, Array]:
    contact, angle = random.uniform(0.0, 1.0, pushes), random.uniform(-ANGLE, ANGLE, pushes)
    speeds = rig.speeds
    if shift == "new_speeds":
        speeds = speeds[-1:] if later else speeds[:-1]
    if shift == "one_side" and later:
        contact = random.uniform(0.0, 0.25, pushes)
    if shift == "angle_range":
        low, high = (0.2, ANGLE) if later else (-ANGLE, 0.3)
        angle = random.uniform(low, high, pushes)
    return contact, angle, random.choice(speeds, pushes)


def _wander(random: np.random.Generator, times: Array, level: float) -> Array:
    """A scalar that wanders slowly around a level, with several swings in a session."""
    knots = np.linspace(0.0, times[-1], int(random.integers(12, 30)))
    smooth = np.interp(times, knots, random.normal(0.0, 1.0, len(knots)))
    return level + 1.5 * smooth + random.normal(0.0, 0.05, len(times))
