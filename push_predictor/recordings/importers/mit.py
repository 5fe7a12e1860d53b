# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of the MIT push data set (Yu, Bauza, Fazeli, Rodriguez, IROS 2016), one recording per file.

The files are JSON or HDF5 with three arrays, single, in folders or in zip archives. Poses are x, y (m) and yaw (rad) in
the robot's base frame, Unix seconds; the wrench is fx, fy (N), tz (N m) along the same axes, of the slider on the
pusher.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.shapes import MASSES, SHAPES, shape_outline
from push_predictor.recordings.importers.cleaning import (
    Samples,
    in_order,
    nanoseconds,
    repair_heading,
    require_overlap,
)
from push_predictor.recordings.importers.staging import ImportReport, Notes, Staging, safe_name, sources_in
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.types import Array

PUSHER_RADIUS = 0.00475
FRAME = (
    "the tracker's body frame is that of the outline, with the origin at its centroid. Hex and ellipses have their "
    "first vertex at heading 0; rect1 has its sides along the axes"
)
FORCE = "the wrench acts from the slider on the pusher, along the axes of the robot's base; it is not tared"
CLOCK = "tip, object and wrench share a clock; no offset was applied"
HEIGHT = "tip and slider are at height 0: the set has planar poses, and the tip is never lifted within a file"
STREAMS = ("tip_pose", "object_pose", "ft_wrench")
SUFFIXES = (".json", ".h5", ".hdf5")
FILES = (*SUFFIXES, ".zip")
METADATA = re.compile(r"(?:^|_)(surface|shape|a|v|i|s|t)=([^_=]+)")


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
            if file.name in map(str, sources):
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
    stamps, wrench = {"tip_pose": tip.stamp, "object_pose": body.stamp}, None
    if len(arrays.get("ft_wrench", ())):
        samples = _samples(arrays["ft_wrench"], f"{file.name}: ft_wrench", own)
        stamps["ft_wrench"] = samples.stamp
        wrench = WrenchStream(samples.stamp, *samples.values.T)
    else:
        own.dropped.append(f"{file.name}: ft_wrench missing; imported without forces")
    require_overlap(stamps, file.name)
    for sentence in (FRAME, FORCE, CLOCK, HEIGHT):
        notes.assume(sentence)
    notes.dropped += own.dropped
    notes.repaired += own.repaired
    return Recording(
        name=safe_name(file.stem),
        rig=rig,
        slider=_poses(body),
        pusher=_poses(tip),
        wrench=wrench,
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


def _poses(samples: Samples) -> PoseStream:
    x, y, heading = samples.values.T
    return PoseStream(samples.stamp, x, y, np.zeros(len(x)), np.unwrap(heading))


@dataclass(frozen=True)
class MitFile:
    """A file: name (with its archive's) and content."""

    name: str
    data: bytes

    @property
    def stem(self) -> str:
        """The file name without folder and suffix."""
        return Path(self.name).stem


@dataclass(frozen=True)
class MitPlace:
    """The location of an unread file: path, and member if path is a zip archive.

    size in bytes, changed in ns since 1970.
    """

    path: Path
    member: str | None
    size: int
    changed: int

    @property
    def name(self) -> str:
        """The name as in MitFile."""
        return str(self.path) if self.member is None else f"{self.path}/{self.member}"


def mit_files(sources: Sequence[Path]) -> Iterator[MitFile]:
    """All files of the set in files, folders (recursive) and zip archives.

    Raises ImportSourceError if a source contains none.
    """
    for path in sources_in(sources, *(f"*{suffix}" for suffix in FILES)):
        if path.suffix.lower() not in FILES:
            raise ImportSourceError(f"{path}: suffix {path.suffix!r}, give {', '.join(FILES)} or a folder")
        places = sorted(mit_places(path), key=lambda place: place.name)
        if not places:
            raise ImportSourceError(f"{path}: the archive contains no {', '.join(SUFFIXES)} file")
        yield from read_places(places)


def mit_places(path: Path) -> list[MitPlace]:
    """The files in a zip archive, or the file itself. Raises ImportSourceError for an unreadable archive."""
    status = path.stat()
    if path.suffix.lower() != ".zip":
        return [MitPlace(path, None, status.st_size, status.st_mtime_ns)]
    with _archive(path) as archive:
        members = [info for info in archive.infolist() if info.filename.lower().endswith(SUFFIXES)]
    return [MitPlace(path, info.filename, info.file_size, status.st_mtime_ns) for info in members]


def read_places(places: Sequence[MitPlace]) -> Iterator[MitFile]:
    """The files at some places; group those of one archive. Raises ImportSourceError, OSError."""
    for path, inside in groupby(places, lambda place: place.path):
        members = [place.member for place in inside if place.member is not None]
        if not members:
            yield MitFile(str(path), path.read_bytes())
            continue
        with _archive(path) as archive:
            for name in members:
                yield MitFile(f"{path}/{name}", archive.read(name))


def paths_in(folder: Path) -> list[Path]:
    """Paths in a folder (recursive) with the suffix of a file of the set or of an archive."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in FILES)


def file_metadata(name: str) -> dict[str, str]:
    """The fields of a file name: surface, shape, a, v (mm/s), i, s, t (rad). Raises ImportSourceError."""
    found: dict[str, str] = dict(METADATA.findall(name.rsplit("/", 1)[-1]))
    if missing := [key for key in ("surface", "shape") if key not in found]:
        raise ImportSourceError(
            f"{name}: the file name lacks {' and '.join(f'{key}=' for key in missing)}; "
            "the set names its files motion_surface=..._shape=..._a=..._v=..._i=..._s=..._t=..."
        )
    return found


def file_arrays(file: MitFile) -> dict[str, Array]:
    """The arrays (n, 4) of a file, by name. Raises ImportSourceError with line, byte or row."""
    raw = _json_lists(file) if file.name.lower().endswith(".json") else _hdf5_arrays(file)
    return {key: _rows(raw[key], f"{file.name}: {key}") for key in STREAMS if key in raw}


@contextmanager
def _archive(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except (
        zipfile.BadZipFile,
        EOFError,
        NotImplementedError,  # raised by zipfile for an unknown compression
        RuntimeError,  # raised for an encrypted member
    ) as error:
        raise ImportSourceError(f"{path}: the archive cannot be read ({error})") from None


def _json_lists(file: MitFile) -> dict[str, object]:
    try:
        content = json.loads(file.data.decode("utf-8"))
    except json.JSONDecodeError as error:
        raise ImportSourceError(f"{file.name}:{error.lineno}: not JSON ({error.msg})") from None
    except UnicodeDecodeError as error:
        raise ImportSourceError(f"{file.name}: byte {error.start}: not UTF-8") from None
    if not isinstance(content, dict):
        raise ImportSourceError(f"{file.name}: a {type(content).__name__}, give an object with {', '.join(STREAMS)}")
    return content


def _hdf5_arrays(file: MitFile) -> dict[str, object]:
    try:
        import h5py
    except ImportError:
        raise ImportSourceError(f"{file.name}: HDF5 needs the package h5py (pip install h5py)") from None
    try:
        with h5py.File(io.BytesIO(file.data), "r") as content:
            return {key: np.array(content[key]) for key in STREAMS if key in content}
    except (OSError, RuntimeError, KeyError, TypeError) as error:
        raise ImportSourceError(f"{file.name}: the HDF5 file cannot be read ({error})") from None


def _rows(raw: object, where: str) -> Array:
    """Rows of four numbers; null is a missing number. Raises ImportSourceError with the row."""
    if not isinstance(raw, (list, np.ndarray)):
        raise ImportSourceError(f"{where}: a {type(raw).__name__}, give a list of rows")
    if len(raw) == 0:
        return np.empty((0, 4))
    try:
        rows = np.array(raw, dtype=np.float64)
    except (TypeError, ValueError):
        rows = np.empty(0)
    if rows.ndim == 2 and rows.shape[1] == 4:
        return rows
    bad = next((k for k, row in enumerate(raw) if not _is_row(row)), 0)
    raise ImportSourceError(f"{where}[{bad}]: {str(raw[bad])[:60]!r}, give four numbers")


def _is_row(row: object) -> bool:
    try:
        return np.shape(np.array(row, dtype=np.float64)) == (4,)
    except (TypeError, ValueError):
        return False
