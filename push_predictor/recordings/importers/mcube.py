# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of the MCube lab's preliminary pushes (August 2015), one recording for each run.

The files are metal_K_{obj,ft,tcp}.txt with one number per line. obj: blocks of time (ns), x, y, z (m), qx, qy, qz in
Vicon's world. ft: time, fx, fy (N) of the sensor. tcp: time, x, y (m) of the tip in the robot's base.

The two metal blocks and their frames: values that the files lack were fitted to the contact. While the pusher touches a
side, the distance of its centre from the block's centre line is half side + pusher radius. test_measured_importers
repeats the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.frames import rotate, to_body, wrap_angle
from push_predictor.geometry.shapes import square
from push_predictor.recordings.importers.cleaning import Samples, in_order, require_overlap, twist, without_repeats
from push_predictor.recordings.importers.staging import ImportReport, Notes, Staging, safe_name, sources_in
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
PUSHER_RADIUS = 0.004745  # m
THICKNESS = 0.0132  # m; that of the MIT set's steel square, 0.837 kg on 0.09 m x 0.09 m
TIP_LATE = 15_000_000  # ns; see CLOCK
CLOCK = (
    "clock: tip stamps are 15 ms late relative to the tracker's and were corrected. A delay test without repeated rows "
    "gives 15.0 ms (rms 0.17 mm). With the repeated rows, which are 12 ms old, it gives 20 to 21 ms. Tracker and force "
    "share a clock"
)
FORCE = (
    "force: the sensor points down, so world (fx, fy) = sensor (fy, fx), from tip_pose's orientation in the bag. Axes "
    "fitted to the contact normals of each block agree within 3 degrees. It is the force of the slider on the pusher, "
    "tared by its mean before the tip first moves"
)
HEIGHT = "height: tip and slider are at 0 where the files contain no height of the tip"


def import_mcube(sources: Sequence[Path], staging: Staging, rig: Rig | None = None) -> ImportReport:
    """One recording FOLDER_RUN for each run in folders (recursive) or named by its *_obj.txt."""
    notes = Notes()
    for path in staging.in_turn(sources_in(sources, "*_obj.txt")):
        if not path.name.endswith("_obj.txt"):
            raise ImportSourceError(f"{path}: give a folder, or NAME_obj.txt next to NAME_ft.txt and NAME_tcp.txt")
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


@dataclass(frozen=True)
class Block:
    """One of the blocks.

    half_side m; density kg/m^3; base: Vicon's origin in the robot's base (x, y) m; centre: the block's centre in the
    tracker's body frame (x, y) m; days: Unix seconds of the sessions.
    """

    name: str
    half_side: float
    density: float
    base: tuple[float, float]
    centre: tuple[float, float]
    days: tuple[float, float]

    @property
    def rig(self) -> Rig:
        """The square block; its mass follows from density, measured side and the assumed thickness."""
        mass = self.density * 4.0 * self.half_side**2 * THICKNESS
        return Rig(f"{self.name}_block", square(2.0 * self.half_side), PUSHER_RADIUS, "unknown", round(mass, 3))

    @property
    def assumed_rig(self) -> str:
        """The assumptions about the block."""
        rig = self.rig
        return (
            f"{self.name}: square of side {2e3 * self.half_side:.1f} mm, from the distance of tip and centre in "
            f"contact. Mass {rig.object_mass} kg, not measured: from density {self.density:.0f} kg/m3 and thickness "
            f"{THICKNESS * 1e3:.1f} mm, that of the MIT set's square; surface unknown"
        )

    @property
    def assumed_frames(self) -> str:
        """The assumptions about the frames."""
        (bx, by), (cx, cy) = self.base, self.centre
        source = (
            "from the recorded transforms"
            if self.base == RECORDED_BASE
            else "fitted to the contacts; the recorded one is 10 mm off"
        )
        return (
            f"{self.name}: the world frame is Vicon's. Its origin in the frame of the robot's base is "
            f"({bx:.4f}, {by:.4f}) m ({source}). The block's centre in the tracked body is "
            f"({1e3 * cx:.2f}, {1e3 * cy:.2f}) mm"
        )


RECORDED_BASE = (0.3958, 0.0019)  # from /tf of the bag
STEEL = Block("steel", 0.0489, 7850.0, RECORDED_BASE, (0.0, 0.0), (1439424000.0, 1439596800.0))
ALUMINIUM = Block("aluminium", 0.0496, 2700.0, (0.3906, -0.0064), (0.00085, 0.0016), (1438560000.0, 1438732800.0))
FOLDERS = {"St": STEEL, "Al": ALUMINIUM}


def block_of(path: Path, stamp: int) -> Block:
    """The block of a file by its folder (St_..., Al_...), else by the day (ns). Raises ImportSourceError."""
    for prefix, block in FOLDERS.items():
        if path.resolve().parent.name.startswith(f"{prefix}_"):
            return block
    for block in FOLDERS.values():
        if block.days[0] <= stamp / 1e9 < block.days[1]:
            return block
    raise ImportSourceError(
        f"{path}: neither folder nor first stamp {stamp} ns identifies the block, name the folder St_... (steel) or "
        "Al_... (aluminium)"
    )
