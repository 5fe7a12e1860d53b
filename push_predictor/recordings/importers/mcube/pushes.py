# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of the MCube lab's preliminary pushes, one recording for each run.

The files are metal_K_{obj,ft,tcp}.txt with one number per line.

obj: blocks of time (ns), x, y, z (m), qx, qy, qz in Vicon's world. ft: time, fx, fy (N) of the sensor.
tcp: time, x, y (m) of the tip in the robot's base.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.recordings.importers.cleaning import Samples, in_order, require_overlap, twist, without_repeats
from push_predictor.recordings.importers.mcube.rig import CLOCK, FORCE, HEIGHT, TIP_LATE, Block, block_of
from push_predictor.recordings.importers.report import ImportReport, Notes
from push_predictor.recordings.importers.staging import Staging, safe_name
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.types import Array

WIDTHS = {"obj": 7, "ft": 3, "tcp": 3}  # numbers per sample
AT_REST = 5e-4  # m; largest distance from the first position at rest
LEAST_TARE = 5
STOPS_EARLY = 1_000_000_000  # ns
NEAR_HALF_TURN = 0.05  # |qw| below which the lost sign of qw may change
IN_TOUCH = 0.002  # m
TREND = 8  # samples that predict the next heading


def import_mcube(sources: Sequence[Path], staging: Staging, rig: Rig | None = None) -> ImportReport:
    """One recording FOLDER_RUN for each run in folders (recursive) or named by its *_obj.txt."""
    notes = Notes()
    for path in staging.in_turn(_runs(sources)):
        staging.recording(read_mcube(path, rig, notes), pushes=1)
    return staging.report("mcube", notes)


def read_mcube(obj: Path, rig: Rig | None, notes: Notes) -> Recording:
    """The run of an *_obj.txt; the other two files are in the same folder. Raises ImportSourceError."""
    stem = obj.name.removesuffix("_obj.txt")
    files = {kind: obj.with_name(f"{stem}_{kind}.txt") for kind in WIDTHS}
    raw = {kind: in_order(read_numbers(path, WIDTHS[kind], notes), str(path), notes) for kind, path in files.items()}
    name, where = safe_name(f"{obj.resolve().parent.name}_{stem}"), str(obj.with_name(stem))
    block, heading = block_of(obj, int(raw["obj"].stamp[0])), headings(raw["obj"].values[:, 3:])
    found = []
    for sign, sign_notes in ((1.0, notes), (-1.0, Notes())):
        body = Samples(raw["obj"].stamp, np.column_stack([raw["obj"].values[:, :2], sign * heading]))
        found.append(assemble(name, where, block, rig, body, raw["tcp"], raw["ft"], sign_notes))
    touches = [samples_in_touch(recording) for recording in found]
    notes.assume(
        f"{where}: the file contains no qw. It is assumed {'positive' if touches[0] >= touches[1] else 'negative'} at "
        f"the first sample, because {max(touches)} tip samples are then on the outline, otherwise {min(touches)}"
    )
    return found[int(touches[1] > touches[0])]


def assemble(
    name: str, where: str, block: Block, rig: Rig | None, body: Samples, tip: Samples, force: Samples, notes: Notes
) -> Recording:
    """A recording in Vicon's world from the streams of the rig.

    body: (n, 3) x, y, heading in Vicon's world. tip: (n, 2) x, y in the robot's base, or (n, 3) with its height.
    force: (n, 2) fx, fy of the sensor, or (n, 3) with tz.
    """
    for sentence in (CLOCK, FORCE, HEIGHT, block.assumed_frames, *(() if rig else (block.assumed_rig,))):
        notes.assume(sentence)
    force = tared(force, tip, where, notes)
    tip = without_repeats(tip, f"{where}: tip", notes)
    tip = tip._replace(stamp=tip.stamp - TIP_LATE)
    require_overlap({"slider": body.stamp, "tip": tip.stamp, "force": force.stamp}, where)
    if (missing := int(body.stamp[-1] - tip.stamp[-1])) > STOPS_EARLY:
        notes.dropped.append(
            f"{where}: the tip stream stops {missing / 1e9:.1f} s before the slider's; later pushes are missing"
        )
    return Recording(
        name=name,
        rig=rig or block.rig,
        slider=_slider(body, block),
        pusher=_pusher(tip, block),
        wrench=_wrench(force),
    )


def samples_in_touch(recording: Recording) -> int:
    """The number of tip samples on the slider's outline."""
    if recording.rig is None:
        return 0
    slider, tip = recording.slider, recording.pusher
    pose = np.column_stack([np.interp(tip.stamp, slider.stamp, z) for z in (slider.x, slider.y, slider.heading)])
    touch = recording.rig.outline.project(to_body(np.column_stack([tip.x, tip.y]), pose))
    return int(np.sum(np.abs(touch.distance - recording.rig.pusher_radius) < IN_TOUCH))


def read_numbers(path: Path, width: int, notes: Notes) -> Samples:
    """Blocks of an integer stamp and width - 1 numbers, one per line.

    Raises ImportSourceError with file and line.
    """
    try:
        lines = path.read_bytes().decode("ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ImportSourceError(f"{path}: cannot be read ({error})") from None
    words = [(number, line.strip()) for number, line in enumerate(lines, start=1) if line.strip()]
    if rest := len(words) % width:
        notes.dropped.append(f"{path}:{words[-rest][0]}: the last sample has {rest} of {width} numbers")
        words = words[:-rest]
    stamps = [_number(path, *word, int) for word in words[::width]]
    values = [_number(path, *word, float) for k, word in enumerate(words) if k % width]
    return Samples(np.array(stamps, dtype=np.int64), np.array(values, dtype=np.float64).reshape(-1, width - 1))


def headings(quaternion: Array) -> Array:
    """Headings (n,) rad, continuous, from qx, qy, qz (n, 3).

    The sign of qw is missing. It is assumed positive at first; near half a turn, where it may change, the heading that
    continues the trend of the previous samples is used.
    """
    qw = np.sqrt(np.maximum(0.0, 1.0 - np.sum(quaternion**2, axis=1)))
    sign, found = 1.0, np.empty(len(qw))
    for k, (z, w) in enumerate(zip(quaternion[:, 2], qw, strict=True)):
        before = found[max(0, k - TREND) : k]
        expected = before[-1] + (before[-1] - before[0]) / max(1, len(before) - 1) if k else twist(z, w)
        off = wrap_angle(twist(z, np.array([sign, -sign]) * w) - expected)
        if w < NEAR_HALF_TURN and abs(off[1]) < abs(off[0]):
            sign, off = -sign, off[::-1]
        found[k] = expected + off[0]
    return found


def tared(force: Samples, tip: Samples, where: str, notes: Notes) -> Samples:
    """Force minus its mean before the tip first moves; stamps of the two streams differ by at most 20 ms."""
    moved = np.flatnonzero(np.hypot(*(tip.values[:, :2] - tip.values[0, :2]).T) > AT_REST)
    start = tip.stamp[moved[0]] - 2 * TIP_LATE if len(moved) else tip.stamp[-1]
    before = force.stamp < start
    if np.sum(before) < LEAST_TARE:
        notes.dropped.append(f"{where}: the tip does not rest before the push, so the force is not tared")
        return force
    zero = force.values[before].mean(axis=0)
    notes.repaired.append(
        f"{where}: force tared by {zero[0]:.3f}, {zero[1]:.3f} N (mean of {int(np.sum(before))} samples at rest)"
    )
    return force._replace(values=force.values - zero)


def _slider(body: Samples, block: Block) -> PoseStream:
    heading = body.values[:, 2]
    centre = body.values[:, :2] + rotate(np.tile(block.centre, (len(heading), 1)), heading)
    return PoseStream(body.stamp, centre[:, 0], centre[:, 1], np.zeros(len(heading)), heading)


def _pusher(tip: Samples, block: Block) -> PoseStream:
    x, y = (tip.values[:, :2] - np.array(block.base)).T
    height = tip.values[:, 2] - np.min(tip.values[:, 2]) if tip.values.shape[1] > 2 else np.zeros(len(x))
    return PoseStream(tip.stamp, x, y, height, np.zeros(len(x)))


def _wrench(force: Samples) -> WrenchStream:
    torque = -force.values[:, 2] if force.values.shape[1] > 2 else np.zeros(len(force.stamp))
    return WrenchStream(force.stamp, force.values[:, 1], force.values[:, 0], torque)


def _number(path: Path, line: int, word: str, kind: type[int] | type[float]) -> float:
    try:
        return kind(word)
    except ValueError:
        wanted = "a whole number of ns" if kind is int else "a number"
        raise ImportSourceError(f"{path}:{line}: {word[:40]!r}, expected {wanted}") from None


def _runs(sources: Sequence[Path]) -> list[Path]:
    found = []
    for source in sources:
        inside = sorted(source.rglob("*_obj.txt")) if source.is_dir() else [source]
        if not inside or not inside[0].name.endswith("_obj.txt") or not inside[0].exists():
            raise ImportSourceError(f"{source}: give a folder that contains NAME_obj.txt, NAME_ft.txt, NAME_tcp.txt")
        found += inside
    return found
