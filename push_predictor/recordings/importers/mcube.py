"""Import of the MCube lab's preliminary pushes: metal_K_{obj,ft,tcp}.txt, one number a line, a recording for each run.

obj: blocks of time (ns), x, y, z (m), qx, qy, qz in Vicon's world. ft: time, fx, fy (N) of the sensor.
tcp: time, x, y (m) of the tip in the robot's base.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.frames import rotate
from push_predictor.recordings.importers.cleaning import Samples, in_order, require_overlap, twist, without_held
from push_predictor.recordings.importers.mcube_rig import TIP_LATE, Block, block_of
from push_predictor.recordings.importers.report import ImportReport, Notes
from push_predictor.recordings.importers.staging import safe_name, staged
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.types import Array

WIDTHS = {"obj": 7, "ft": 3, "tcp": 3}  # numbers a sample
AT_REST = 5e-4  # m; the tip has not left its first position
LEAST_TARE = 5
STOPS_EARLY = 1_000_000_000  # ns
NEAR_HALF_TURN = 0.05  # |qw| below which the lost sign of qw may change
AT_HALF_TURN = 0.02


def import_mcube(sources: Sequence[Path], out: Path, rig: Rig | None = None) -> ImportReport:
    """One recording FOLDER_RUN for each run in folders (recursive) or named by its *_obj.txt."""
    notes = Notes()
    with staged(out) as staging:
        for path in _runs(sources):
            staging.recording(read_mcube(path, rig, notes), pushes=1)
    return staging.report("mcube", notes)


def read_mcube(obj: Path, rig: Rig | None, notes: Notes) -> Recording:
    """The run whose *_obj.txt is given; the other two files lie beside it. Raises ImportSourceError."""
    stem = obj.name.removesuffix("_obj.txt")
    files = {kind: obj.with_name(f"{stem}_{kind}.txt") for kind in WIDTHS}
    raw = {kind: in_order(read_numbers(path, WIDTHS[kind], notes), str(path), notes) for kind, path in files.items()}
    body = Samples(raw["obj"].stamp, np.column_stack([raw["obj"].values[:, :2], headings(raw["obj"].values[:, 3:])]))
    name = safe_name(f"{obj.resolve().parent.name}_{stem}")
    return assemble(name, str(obj.with_name(stem)), block_of(obj, int(body.stamp[0])), rig, body, raw["tcp"], raw["ft"], notes)


def assemble(
    name: str, where: str, block: Block, rig: Rig | None, body: Samples, tip: Samples, force: Samples, notes: Notes
) -> Recording:
    """A recording in Vicon's world from what the rig delivered.

    body: (n, 3) x, y, heading in Vicon's world. tip: (n, 2) x, y in the robot's base, or (n, 3) with its height.
    force: (n, 2) fx, fy of the sensor, or (n, 3) with tz.
    """
    block.assume(notes)
    force = tared(force, tip, where, notes)
    tip = without_held(tip, f"{where}: tip", notes)
    tip = tip._replace(stamp=tip.stamp - TIP_LATE)
    require_overlap({"slider": body.stamp, "tip": tip.stamp, "force": force.stamp}, where)
    if (missing := int(body.stamp[-1] - tip.stamp[-1])) > STOPS_EARLY:
        notes.dropped.append(f"{where}: the tip stream stops {missing / 1e9:.1f} s before the slider's, no push beyond that")
    return Recording(
        name=name,
        rig=rig or block.rig,
        slider=_slider(body, block),
        pusher=_pusher(tip, block),
        wrench=_wrench(force),
    )


def read_numbers(path: Path, width: int, notes: Notes) -> Samples:
    """Blocks of one integer stamp and width - 1 numbers, one a line. Raises ImportSourceError with file and line."""
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
    """Headings (n,) rad, continuous, from qx, qy, qz (n, 3); qw has lost its sign and is taken to pass through zero
    where the heading passes through half a turn."""
    qw = np.sqrt(np.maximum(0.0, 1.0 - np.sum(quaternion**2, axis=1)))
    low = np.concatenate([[False], qw < NEAR_HALF_TURN, [False]])
    starts, ends = np.flatnonzero(low[1:] & ~low[:-1]), np.flatnonzero(~low[1:] & low[:-1])
    sign = np.ones(len(qw))
    for start, end in zip(starts, ends, strict=True):
        crossing = start + int(np.argmin(qw[start:end]))
        if 0 < start and end < len(qw) and qw[crossing] < AT_HALF_TURN:
            sign[crossing:] *= -1.0
    return np.unwrap(twist(quaternion[:, 2], sign * qw))


def tared(force: Samples, tip: Samples, where: str, notes: Notes) -> Samples:
    """Force without its mean from before the tip first moves (two stamps of one instant differ by 20 ms at most)."""
    moved = np.flatnonzero(np.hypot(*(tip.values[:, :2] - tip.values[0, :2]).T) > AT_REST)
    start = tip.stamp[moved[0]] - 2 * TIP_LATE if len(moved) else tip.stamp[-1]
    before = force.stamp < start
    if np.sum(before) < LEAST_TARE:
        notes.dropped.append(f"{where}: no rest before the push, the force is not tared")
        return force
    zero = force.values[before].mean(axis=0)
    notes.repaired.append(
        f"{where}: force tared by {', '.join(f'{value:.3f}' for value in zero[:2])} N (mean of {int(np.sum(before))} samples at rest)"
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
        raise ImportSourceError(f"{path}:{line}: {word[:40]!r}, expected {'a time in ns' if kind is int else 'a number'}") from None


def _runs(sources: Sequence[Path]) -> list[Path]:
    found = []
    for source in sources:
        inside = sorted(source.rglob("*_obj.txt")) if source.is_dir() else [source]
        if not inside or not inside[0].name.endswith("_obj.txt") or not inside[0].exists():
            raise ImportSourceError(f"{source}: give a folder that holds NAME_obj.txt, NAME_ft.txt, NAME_tcp.txt")
        found += inside
    return found
