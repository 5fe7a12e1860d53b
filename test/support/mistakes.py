# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The usual mistakes of a laboratory's recording, made in a sound one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from lab_bags import pose_rows
from repository import REPOSITORY

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.checks.geometry import swapped
from push_predictor.recordings.decoder.rules import slider_stream
from push_predictor.recordings.fields.pose_rows import composed, normalised
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, taken
from push_predictor.types import Array

BAGS = sorted(path.name for path in (REPOSITORY / "bags").iterdir() if path.is_dir())
TRACKER_NOISE = 3e-5  # m
TILT = np.array([0.002, -0.001])  # rad
UPRIGHT, UPSIDE_DOWN = np.array([0.0, 0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0, 0.0])
Mistake = Callable[[Recording], Recording]


def outline_scaled(rig: Rig, size: float) -> Rig:
    """The rig with a scaled outline; for polygons."""
    return replace(rig, outline=Outline(size * rig.outline.vertices))


def mirrored(recording: Recording, y: float, heading: float) -> Recording:
    """The recording with the slider's y and heading multiplied by the given signs."""
    slider = recording.slider
    return replace(recording, slider=replace(slider, y=y * slider.y, heading=heading * slider.heading))


def tracked(recording: Recording, yaw: float, shift: tuple[float, float]) -> Recording:
    """The recording of a tracked frame whose origin is at `shift` in the slider's, turned by `yaw` against it."""
    slider = recording.slider
    move = rotate(np.array(shift), slider.heading)
    heading = wrap_angle(slider.heading + yaw)
    return replace(recording, slider=replace(slider, x=slider.x + move[:, 0], y=slider.y + move[:, 1], heading=heading))


def stream_part(poses: PoseStream, begin: float, end: float) -> PoseStream:
    """The samples between two shares of a stream."""
    return taken(poses, slice(round(begin * len(poses)), round(end * len(poses))))


def scaled(recording: Recording, stream: str, factor: float) -> Recording:
    """Positions of a stream in another unit."""
    poses: PoseStream = getattr(recording, stream)
    return replace(recording, **{stream: replace(poses, x=factor * poses.x, y=factor * poses.y)})


def heading_in_degrees(recording: Recording) -> Recording:
    """Degrees given to a function that makes quaternions of radians."""
    heading = wrap_angle(np.degrees(np.unwrap(recording.slider.heading)))
    return replace(recording, slider=replace(recording.slider, heading=heading))


def stamps_scaled(recording: Recording, factor: float) -> Recording:
    """The slider's stamps in another unit."""
    slider = recording.slider
    stamp = slider.stamp[0] + ((slider.stamp - slider.stamp[0]) * factor).astype(np.int64)
    return replace(recording, slider=replace(slider, stamp=stamp))


def late(recording: Recording, seconds: float) -> Recording:
    """The slider's stamps are that much late."""
    slider = recording.slider
    return replace(recording, slider=replace(slider, stamp=slider.stamp + round(seconds * 1e9)))


def another_body(recording: Recording) -> Recording:
    """A body that spins half a metre away."""
    slider = recording.slider
    return replace(recording, slider=replace(slider, x=slider.x + 0.5, heading=np.linspace(0.0, 10.0, len(slider))))


def on_hand(recording: Recording, place: tuple[float, float] = (0.03, 0.0)) -> Recording:
    """The pose of a body that is fixed to the robot's hand, at that place (m) from the tip, instead of the slider's."""
    tip, draw = recording.pusher, np.random.default_rng(0)
    x, y = np.array(place)[:, None] + TRACKER_NOISE * draw.standard_normal((2, len(tip)))
    heading = 0.3 + 10.0 * TRACKER_NOISE * draw.standard_normal(len(tip))
    return replace(recording, slider=PoseStream(tip.stamp, tip.x + x, tip.y + y, tip.z - 0.01, heading))


def spatial_rows(stream: PoseStream, turn: Array = UPRIGHT) -> Array:
    """Poses (n, 7) as a tracker gives them: tilted by 2 mrad, with as much noise; turn: a quaternion, in the body."""
    rows, draw = pose_rows(stream), np.random.default_rng(0)
    n = len(rows)
    tilt = np.column_stack([0.5 * (TILT + TILT[0] * draw.standard_normal((n, 2))), np.zeros(n), np.ones(n)])
    own = np.tile(turn, (n, 1))
    none = np.zeros((n, 3))
    return composed(composed(rows, normalised(np.hstack([none, tilt]))), np.hstack([none, own]))


def w_first(recording: Recording) -> Recording:
    """Quaternions (w, x, y, z) that are read as (x, y, z, w)."""
    rows = spatial_rows(recording.slider)[:, [0, 1, 2, 6, 3, 4, 5]]
    return replace(recording, slider=slider_stream(recording.slider.stamp, rows))


def without_orientation(recording: Recording) -> Recording:
    """The identity in place of orientations."""
    return replace(recording, slider=replace(recording.slider, heading=0.0 * recording.slider.heading))


def force_scaled(recording: Recording, factor: float) -> Recording:
    """The force in another unit, or none."""
    wrench = recording.wrench
    assert wrench is not None
    return replace(recording, wrench=replace(wrench, fx=factor * wrench.fx, fy=factor * wrench.fy))


def force_constant(recording: Recording, angle: float) -> Recording:
    """A force of 2 N in one direction (rad) of the world all the time."""
    wrench = recording.wrench
    assert wrench is not None
    fx, fy = 2.0 * np.cos(angle), 2.0 * np.sin(angle)
    return replace(recording, wrench=replace(wrench, fx=np.full(len(wrench), fx), fy=np.full(len(wrench), fy)))


def force_of_another_time(recording: Recording, share: float = 1.0 / 3.0) -> Recording:
    """The force rolled by a share of the recording."""
    wrench = recording.wrench
    assert wrench is not None
    by = round(share * len(wrench))
    return replace(recording, wrench=replace(wrench, fx=np.roll(wrench.fx, by), fy=np.roll(wrench.fy, by)))


def force_of_random_direction(recording: Recording) -> Recording:
    """The force of the slider, each sample in a direction of its own."""
    assert recording.wrench is not None
    return force_turned(recording, np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, len(recording.wrench)))


def force_turned(recording: Recording, angle: Array | float) -> Recording:
    """The force along axes that are turned by minus the angle (rad), of the whole or of each sample."""
    wrench = recording.wrench
    assert wrench is not None
    force = rotate(np.column_stack([wrench.fx, wrench.fy]), np.asarray(angle))
    return replace(recording, wrench=replace(wrench, fx=force[:, 0], fy=force[:, 1]))


def force_in_slider_frame(recording: Recording) -> Recording:
    """The force along the slider's axes instead of the world's."""
    wrench, slider = recording.wrench, recording.slider
    assert wrench is not None
    return force_turned(recording, -np.interp(wrench.stamp, slider.stamp, np.unwrap(slider.heading)))


# {name: (the mistake, finding, severity)}
MISTAKES: Mapping[str, tuple[Mistake, str, str]] = {
    "slider in mm": (lambda r: scaled(r, "slider", 1e3), "units_length_slider", "refused"),
    "pusher in mm": (lambda r: scaled(r, "pusher", 1e3), "units_length_pusher", "refused"),
    "both in mm": (lambda r: scaled(scaled(r, "pusher", 1e3), "slider", 1e3), "units_length_slider", "refused"),
    "heading in degrees": (heading_in_degrees, "units_heading", "refused"),
    "stamps in ms": (lambda r: stamps_scaled(r, 1e3), "units_time_slider", "refused"),
    "w first": (w_first, "quaternion_order", "refused"),
    "no orientation": (without_orientation, "heading_constant", "refused"),
    "topics exchanged": (swapped, "topics_swapped", "refused"),
    "another body": (another_body, "another_body", "refused"),
    "body on the hand": (on_hand, "another_body", "refused"),
    "mirrored": (lambda r: mirrored(r, -1.0, -1.0), "frame_mirrored", "warning"),
    "clockwise heading": (lambda r: mirrored(r, 1.0, -1.0), "heading_clockwise", "warning"),
    "turned": (lambda r: tracked(r, np.radians(4.0), (0.0, 0.0)), "outline_turned", "warning"),
    "shifted": (lambda r: tracked(r, 0.0, (0.002, 0.0)), "outline_shifted", "warning"),
    "clocks apart": (lambda r: late(r, 0.05), "clocks_apart", "warning"),
    "wrench of the wrong sign": (lambda r: force_turned(r, np.pi), "wrench_sign", "warning"),
    "wrench along other axes": (lambda r: force_turned(r, np.pi / 2.0), "wrench_frame", "warning"),
    "no wrench": (lambda r: force_scaled(r, 0.0), "wrench_absent", "warning"),
    "wrench in mN": (lambda r: force_scaled(r, 1e3), "wrench_units", "warning"),
    "constant wrench": (lambda r: force_constant(r, 1.0), "wrench_constant", "warning"),
    "wrench of another time": (force_of_another_time, "wrench_unrelated", "warning"),
    "wrench of random direction": (force_of_random_direction, "wrench_unrelated", "warning"),
}
