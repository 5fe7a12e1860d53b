# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes measured by other laboratories as recordings that push_replay plays: mcube's long pushes, mlab's push logs.

mcube: the runs of a block, each up to the end of its push, become one recording, with their stamps. mlab: a log becomes
one recording. It has the slider's pose only before and after a push, and the tip in steps of 0.1 mm: `_streams`
reconstructs the poses between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from examples.hidden import until
from push_predictor.geometry.frames import rotate
from push_predictor.models.mechanics.surface import uniform_ellipsoid
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.importers.cleaning import nanoseconds
from push_predictor.recordings.importers.mlab import (
    MILLIMETRE,
    LogPush,
    NotAPushError,
    folder_rig,
    force_samples,
    push_row,
    read_log,
)
from push_predictor.recordings.importers.staging import Notes
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.recordings.streams import joined as chained
from push_predictor.recordings.windows.contact import NEAR
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.types import Array

MCUBE, MLAB = Path("mcube_preliminary"), Path("mlab", "sensor_log")
POSE_RATE = 50.0  # Hz, of reconstructed poses; mlab's robot logged at 30 Hz
FEWEST_RUNS = 3
TRACED_SHARE = 0.8  # of the pushes of an mlab log; the others are replayed after the trace


@dataclass(frozen=True, eq=False)
class Split:
    """The recordings of one loop, in order of time; pushes are whole.

    training: the base model is trained on it. traced: replayed first, and traced. later: replayed after the trace.
    known: what is known of the change between training and the others. The nodes do not get it.
    """

    name: str
    training: Recording
    traced: Recording
    later: Recording
    known: str


def mcube_splits(data: Path, work: Path) -> list[Split]:
    """For each block: train on the first half of its runs, trace the third quarter, keep the last.

    A run is one push. A block with fewer than FEWEST_RUNS runs has no split.
    """
    runs = [_until_last_window(read_recording(path)) for path in import_source("mcube", [data / MCUBE], work).written]
    by_block: dict[str, list[Recording]] = {}
    for run in sorted(runs, key=lambda run: int(run.slider.stamp[0])):
        by_block.setdefault(require_rig(run).shape, []).append(run)
    return [_mcube_split(block, runs) for block, runs in sorted(by_block.items()) if len(runs) >= FEWEST_RUNS]


def mlab_splits(data: Path, traced_share: float = TRACED_SHARE) -> list[Split]:
    """For each surface: train on its first log in time, then a split for each later log, on other supports."""
    logs = sorted(
        (_read(path) for path in sorted((data / MLAB).glob("*/exp*.txt*"))), key=lambda log: log.pushes[0].time
    )
    surfaces = sorted({log.rig.surface for log in logs})
    of_surface = [[log for log in logs if log.rig.surface == surface] for surface in surfaces]
    return [_mlab_split(first, log, traced_share) for first, *others in of_surface for log in others]


def joined(recordings: Sequence[Recording], name: str) -> Recording:
    """Recordings of one rig, in order of time, as one recording with all their samples and stamps."""
    first = recordings[0]
    wrenches = [recording.wrench for recording in recordings if recording.wrench is not None]
    return replace(
        first,
        name=name,
        slider=chained([recording.slider for recording in recordings]),
        pusher=chained([recording.pusher for recording in recordings]),
        wrench=chained(wrenches) if len(wrenches) == len(recordings) else None,
    )


def _mcube_split(block: str, runs: Sequence[Recording]) -> Split:
    half, three_quarters = len(runs) // 2, (3 * len(runs)) // 4
    training, traced, later = runs[:half], runs[half:three_quarters], runs[three_quarters:]
    known = "nothing was changed on purpose; the runs differ in contact and angle"
    return Split(
        f"mcube {block}", joined(training, "training"), joined(traced, "traced"), joined(later, "later"), known
    )


def _until_last_window(run: Recording) -> Recording:
    """A run without the robot's way back: its accelerations load the sensor as much as a light block does."""
    last = find_windows(run, require_rig(run))[-1].end
    return until(run, (last - min(run.slider.stamp[0], run.pusher.stamp[0])) * 1e-9 + NEAR)


# --- mlab -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Log:
    """A log: the name of its folder, its rig, and its pushes in order of time."""

    name: str
    rig: Rig
    pushes: list[LogPush]


def _read(path: Path) -> _Log:
    """A log whose pushes are in order of time: one log joins two sessions, the later one first."""
    notes = Notes()
    pushes = sorted(read_log(path, notes), key=lambda push: push.time)
    return _Log(path.parent.name, folder_rig(path.parent.name, notes), pushes)


def _mlab_split(first: _Log, log: _Log, traced_share: float) -> Split:
    count = round(traced_share * len(log.pushes))
    traced, later = log.pushes[:count], log.pushes[count:]
    return Split(
        f"mlab {first.name} to {log.name}",
        training=_recording("training", first.rig, first.pushes),
        traced=_recording("traced", log.rig, traced),
        later=_recording("later", log.rig, later),
        known=_known(first.rig, log.rig),
    )


def _known(before: Rig, after: Rig) -> str:
    """The supports in words, and as values of the mechanism pressure_spread for a model with even pressure."""
    even = _arm(replace(before, support_points=None))
    arms = [_arm(rig) for rig in (before, after)]
    lengths = "{:.1f} mm in training, {:.1f} mm later".format(*(1e3 * arm for arm in arms))
    spreads = "{:+.2f} in training, {:+.2f} later".format(*(np.log(arm / even) for arm in arms)).replace("-", "−")
    return f"mean distance of the load from the centre {lengths}; pressure_spread {spreads}"


def _arm(rig: Rig) -> float:
    """Mean distance (m) of the load from the centre; a flat face is taken as evenly loaded."""
    if rig.support_points is None:
        return uniform_ellipsoid(rig.outline).length
    return float(np.hypot(*rig.support_points[:, :2].T) @ rig.support_points[:, 2])


def _recording(name: str, rig: Rig, pushes: Sequence[LogPush]) -> Recording:
    """The streams of a log's pushes. The rig's support points are withheld: the trace is to find what they do."""
    streams = [streams for push in pushes if (streams := _streams(push, rig, name)) is not None]
    return joined(streams, name)


def _streams(push: LogPush, rig: Rig, name: str) -> Recording | None:
    """A push as streams, None if it cannot be a push.

    The tip moves straight and at constant speed, as commanded. From first touch on the slider moves from the pose
    before to the pose after in proportion to the tip. The force is as logged.
    """
    try:
        row = push_row(push, rig.outline)
    except NotAPushError:
        return None
    begin, end = push.robot[0, 0], _last_motion(push)
    time = np.arange(begin, end, 1.0 / POSE_RATE)
    ahead = time - (end - row.duration)  # s since first touch
    tip = push.robot[[0, -1], 1:3] * MILLIMETRE
    travel, direction = float(np.hypot(*(tip[1] - tip[0]))), np.array([np.cos(row.heading), np.sin(row.heading)])
    reach = travel - row.velocity * row.duration
    way = np.clip(reach + row.velocity * ahead, 0.0, travel)
    moved = np.append(rotate(row.outcome[:2], np.array(row.heading)), row.outcome[2])
    slider = row.slider + np.clip(ahead / row.duration, 0.0, 1.0)[:, None] * moved
    return Recording(
        name=name,
        rig=replace(rig, support_points=None),
        slider=_poses(time, slider),
        pusher=_poses(time, np.column_stack([tip[0] + way[:, None] * direction, np.zeros(len(time))])),
        wrench=_wrench(push),
    )


def _last_motion(push: LogPush) -> float:
    """Time (s) of the last logged motion of the tip."""
    moves = np.flatnonzero(np.any(np.diff(push.robot[:, 1:3], axis=0) != 0.0, axis=1))
    return float(push.robot[moves[-1] + 1, 0])


def _poses(time: Array, pose: Array) -> PoseStream:
    """A stream at times (n,) s of poses (n, 3) m, rad."""
    x, y, heading = pose.T
    return PoseStream(nanoseconds(time), x, y, np.zeros(len(time)), heading)


def _wrench(push: LogPush) -> WrenchStream:
    """The force of the slider on the finger; the log has no torque."""
    fx, fy = -force_samples(push.force, push.robot).T
    return WrenchStream(nanoseconds(push.force[:, 0]), fx, fy, np.zeros(len(fx)))
