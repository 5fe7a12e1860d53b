# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Recordings with an exactly known motion: a pusher on a straight line, a slider with a given motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream, taken
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import WindowFinder, find_windows
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
from push_predictor.types import Array, IntArray

START = 1_600_000_000_000_000_000  # ns
RADIUS = 0.00475
rows = wrench_rows = taken  # samples of a stream, by mask, indices or slice


def square_rig() -> Rig:
    """The square of the MIT set."""
    return Rig("rect1", shape_outline("rect1"), RADIUS, "plywood", 0.837)


def square_pushes(count: int, seed: int = 0) -> tuple[PushTable, Rig]:
    """Windows of the square on ABS by the analytical model, three per push, with noise that grows with the angle."""
    rng, rig = np.random.default_rng(seed), replace(square_rig(), surface="abs")
    inputs = np.column_stack([np.full(count, 0.02), rng.random(count), rng.uniform(-1.0, 1.0, count)])
    duration = np.full(count, 0.2)
    outcomes = analytical_mechanics(rig.outline, rig.pusher_radius).displacement(inputs, duration)
    outcomes += rng.standard_normal((count, 3)) * [1e-4, 2e-4, 5e-3] * (0.3 + np.abs(inputs[:, 2:]))
    return PushTable(inputs, duration, outcomes, np.array([f"p{k // 3}" for k in range(count)])), rig


def noisy_pushes(n: int = 120, seed: int = 0, rig: Rig | None = None, windows_per_push: int = 3) -> PushTable:
    """Analytical outcomes with noise that grows with the angle."""
    rig = rig or square_rig()
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(0.01, 0.05, n), rng.random(n), rng.uniform(-1.0, 1.0, n)])
    duration = np.full(n, 0.2)
    exact = analytical_mechanics(rig.outline, rig.pusher_radius).displacement(inputs, duration)
    noise = rng.standard_normal((n, 3)) * [1e-4, 1e-4, 3e-3] * (0.3 + np.abs(inputs[:, 2:]))
    push_id = np.array([f"{seed}-{k // windows_per_push}" for k in range(n)])
    return PushTable(inputs, duration, exact + noise, push_id, {"elapsed_time": np.arange(float(n))})


@dataclass(frozen=True)
class Push:
    """A push along the inward normal of the slider, which moves with the pusher and does not turn.

    begin and end of contact, s; speed m/s. The pusher comes from and goes back to 20 mm before the touch.
    """

    begin: float = 0.5
    end: float = 1.6
    speed: float = 0.02


def translating_push(
    push: Push = Push(), *, contact: float = 0.125, rate: float = 100.0, tail: float = 0.8
) -> Recording:
    """The slider is pushed from rest at the origin by a tip that always moves at the speed of the push."""
    rig = square_rig()
    time = np.arange(0.0, push.end + tail, 1.0 / rate)
    driven = np.clip(time, push.begin, push.end) - push.begin
    normal = rig.outline.inward_normal(np.array([contact]))[0]
    touch = rig.outline.point(np.array([contact]))[0] - RADIUS * normal
    away = push.speed * (np.minimum(time - push.begin, 0.0) - np.maximum(time - push.end, 0.0))
    slider = driven[:, None] * push.speed * normal
    pusher = touch + slider + away[:, None] * normal
    force = np.where((time >= push.begin) & (time <= push.end), 2.0, 0.0)[:, None] * -normal
    return Recording(
        "translating",
        rig,
        pose_stream(time, slider, np.zeros_like(time)),
        pose_stream(time, pusher, np.zeros_like(time)),
        WrenchStream(stamps(time), force[:, 0], force[:, 1], np.zeros_like(time)),
    )


def stamps(time: Array) -> IntArray:
    """Header stamps (ns) of times (s)."""
    return START + np.round(time * 1e9).astype(np.int64)


def pose_stream(time: Array, position: Array, heading: Array) -> PoseStream:
    """A pose stream in the plane z = 0."""
    return PoseStream(stamps(time), position[:, 0], position[:, 1], np.zeros_like(time), heading)


def moved(recording: Recording, shift: Array, turn: float) -> Recording:
    """The recording in a world that is rotated by `turn` (rad) and shifted (2,) m."""
    wrench = recording.wrench
    assert wrench is not None
    force = rotate(np.column_stack([wrench.fx, wrench.fy]), np.array(turn))
    return replace(
        recording,
        slider=_moved_pose(recording.slider, shift, turn),
        pusher=_moved_pose(recording.pusher, shift, turn),
        wrench=WrenchStream(wrench.stamp, force[:, 0], force[:, 1], wrench.torque),
    )


def _moved_pose(stream: PoseStream, shift: Array, turn: float) -> PoseStream:
    world = to_world(np.column_stack([stream.x, stream.y]), np.array([*shift, turn]))
    return PoseStream(stream.stamp, world[:, 0], world[:, 1], stream.z, stream.heading + turn)


def feed(finder: WindowFinder, recording: Recording, part: Callable[[Any], Any] = lambda stream: stream) -> None:
    """Add a part of each stream."""
    finder.add_wrench(part(recording.wrench))
    finder.add_pusher(part(recording.pusher))
    finder.add_slider(part(recording.slider))


def windows_of(recording: Recording, options: WindowOptions | None = None) -> list[PushWindow]:
    """The windows of a recording with a rig."""
    return find_windows(recording, require_rig(recording), options)


def triangle() -> Outline:
    """A right triangle about its centroid, without symmetry."""
    return Outline(np.array([[-0.05, -0.05], [0.1, -0.05], [-0.05, 0.1]]))
