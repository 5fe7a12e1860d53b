# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of the MIT push data set (Yu, Bauza, Fazeli, Rodriguez, IROS 2016), one recording per file.

Poses are x, y (m) and yaw (rad) in the robot's base frame, Unix seconds; the wrench is fx, fy (N), tz (N m) along the
same axes, of the slider on the pusher.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.shapes import SHAPES, shape_outline
from push_predictor.recordings.importers.cleaning import Samples, in_order, nanoseconds, require_overlap
from push_predictor.recordings.importers.heading import repair_heading
from push_predictor.recordings.importers.mit.source import MitFile, file_arrays, file_metadata, mit_files
from push_predictor.recordings.importers.report import ImportReport, Notes
from push_predictor.recordings.importers.staging import Staging, safe_name
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.types import Array

PUSHER_RADIUS = 0.00475
MASSES = {"rect1": 0.837, "ellip1": 0.894, "ellip2": 1.110, "ellip3": 1.334, "hex": 0.983}  # kg; Yu et al. 2016
FRAME = (
    "the tracker's body frame is that of the outline, with the origin at its centroid. Hex and ellipses have their "
    "first vertex at heading 0; rect1 has its sides along the axes"
)
FORCE = "the wrench acts from the slider on the pusher, along the axes of the robot's base; it is not tared"
CLOCK = "tip, object and wrench share a clock; no offset was applied"
HEIGHT = "tip and slider are at height 0: the set has planar poses, and the tip is never lifted within a file"


def import_mit(sources: Sequence[Path], staging: Staging, rig: Rig | None = None) -> ImportReport:
    """One recording for each file in files, folders and zip archives.

    An unreadable file in a folder or archive is reported as dropped. Raises ImportSourceError for an unreadable file
    that was named itself, and if no file can be read. rig: for a shape that is not in the set.
    """
    notes = Notes()
    for file in mit_files(sources):
        try:
            recording = read_mit(file, rig, notes)
        except ImportSourceError as error:
            if file.alone:
                raise
            notes.dropped.append(f"{error}; file skipped")
            continue
        staging.recording(recording, pushes=1)
    if not staging.recordings:
        raise ImportSourceError(f"no file could be imported; the first: {notes.dropped[0]}")
    return staging.report("mit", notes)


def read_mit(file: MitFile, rig: Rig | None, notes: Notes) -> Recording:
    """One push. Raises ImportSourceError if the shape is unknown or a pose stream is missing."""
    rig = rig or shape_rig(file)
    own = Notes()
    arrays = file_arrays(file)
    if missing := [key for key in ("tip_pose", "object_pose") if not len(arrays.get(key, ()))]:
        raise ImportSourceError(f"{file.name}: {' and '.join(missing)} missing; a recording needs both poses")
    tip = _samples(arrays["tip_pose"], f"{file.name}: tip_pose", own)
    body = _steady(_samples(arrays["object_pose"], f"{file.name}: object_pose", own), rig, file.name, own)
    wrench = None
    if len(arrays.get("ft_wrench", ())):
        wrench = _samples(arrays["ft_wrench"], f"{file.name}: ft_wrench", own)
    else:
        own.dropped.append(f"{file.name}: ft_wrench missing; imported without forces")
    streams = {"tip_pose": tip, "object_pose": body, **({"ft_wrench": wrench} if wrench else {})}
    require_overlap({name: stream.stamp for name, stream in streams.items()}, file.name)
    for sentence in (FRAME, FORCE, CLOCK, HEIGHT):
        notes.assume(sentence)
    notes.dropped += own.dropped
    notes.repaired += own.repaired
    return Recording(
        name=safe_name(file.stem),
        rig=rig,
        slider=_poses(body),
        pusher=_poses(tip._replace(values=_unwound(tip.values))),
        wrench=None if wrench is None else WrenchStream(wrench.stamp, *wrench.values.T),
    )


def shape_rig(file: MitFile) -> Rig:
    """The rig from the file name. Raises ImportSourceError for a shape that is not in SHAPES."""
    metadata = file_metadata(file.name)
    shape = metadata["shape"]
    if shape not in SHAPES:
        raise ImportSourceError(
            f"{file.name}: shape {shape!r} is unknown, accepted are {', '.join(SHAPES)}; "
            "give another one's outline with --rig FILE.yaml"
        )
    return Rig(shape, shape_outline(shape), PUSHER_RADIUS, metadata["surface"], MASSES[shape])


def _samples(rows: Array, where: str, notes: Notes) -> Samples:
    timed = np.isfinite(rows[:, 0])
    if untimed := int(np.sum(~timed)):
        notes.dropped.append(f"{where}: {untimed} rows without a time")
    rows = rows[timed]
    return in_order(Samples(nanoseconds(rows[:, 0]), rows[:, 1:]), where, notes)


def _steady(samples: Samples, rig: Rig, name: str, notes: Notes) -> Samples:
    """The slider's samples with a continuous heading."""
    time = (samples.stamp - samples.stamp[0]) * 1e-9
    repair = repair_heading(time, samples.values[:, 2], rig.outline.rotational_symmetry)
    lost = int(np.sum(~repair.keep))
    if repair.undone:
        notes.repaired.append(f"{name}: object_pose: {repair.undone} jumps of the yaw by quarter turns were undone")
    if repair.cut:
        notes.dropped.append(
            f"{name}: object_pose: {repair.cut} jumps of the yaw that the symmetry of {rig.shape} does not explain; "
            f"the longest part without such a jump is kept"
        )
    if lost:
        notes.dropped.append(f"{name}: object_pose: {lost} of {len(repair.keep)} rows in or beyond jumps of the yaw")
    if np.sum(repair.keep) < 2:
        raise ImportSourceError(f"{name}: object_pose: every two successive rows have a jump of the yaw between them")
    steady = np.column_stack([samples.values[:, :2], repair.heading])
    return Samples(samples.stamp, steady).take(repair.keep)


def _unwound(values: Array) -> Array:
    return np.column_stack([values[:, :2], np.unwrap(values[:, 2])])


def _poses(samples: Samples) -> PoseStream:
    x, y, heading = samples.values.T
    return PoseStream(samples.stamp, x, y, np.zeros(len(x)), heading)
