# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Files of the MIT push data set: JSON or HDF5 with three arrays, single, in folders, in zip archives."""

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
from push_predictor.types import Array

STREAMS = ("tip_pose", "object_pose", "ft_wrench")
JSON_SUFFIXES = (".json",)
HDF5_SUFFIXES = (".h5", ".hdf5")
SUFFIXES = (*JSON_SUFFIXES, *HDF5_SUFFIXES)
METADATA = re.compile(r"(?:^|_)(surface|shape|a|v|i|s|t)=([^_=]+)")


@dataclass(frozen=True)
class MitFile:
    """A file: name (with its archive's) and content. alone: the caller named this file itself."""

    name: str
    data: bytes
    alone: bool

    @property
    def stem(self) -> str:
        """The file name without folder and suffix."""
        base = self.name.rsplit("/", 1)[-1]
        return next(base[: -len(suffix)] for suffix in SUFFIXES if base.lower().endswith(suffix))


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
    for source in sources:
        if not source.exists():
            raise ImportSourceError(f"{source}: does not exist, give a file, a folder or a zip archive")
        paths = [source]
        if source.is_dir():
            paths = paths_in(source)
        if not paths:
            raise ImportSourceError(f"{source}: contains no {', '.join(SUFFIXES)} or .zip file")
        for path in paths:
            yield from _files_of(path, alone=path == source)


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
        if members:
            yield from _members(path, members)
        else:
            yield MitFile(str(path), path.read_bytes(), alone=False)


def paths_in(folder: Path) -> list[Path]:
    """Paths in a folder (recursive) with the suffix of a file of the set or of an archive."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in (*SUFFIXES, ".zip"))


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
    raw = _json_lists(file) if file.name.lower().endswith(JSON_SUFFIXES) else _hdf5_arrays(file)
    return {key: _rows(raw[key], f"{file.name}: {key}") for key in STREAMS if key in raw}


def _files_of(path: Path, alone: bool) -> Iterator[MitFile]:
    if path.suffix.lower() == ".zip":
        yield from _zipped(path)
    elif path.suffix.lower() in SUFFIXES:
        yield MitFile(str(path), path.read_bytes(), alone)
    else:
        raise ImportSourceError(f"{path}: suffix {path.suffix!r}, give {', '.join(SUFFIXES)}, .zip or a folder")


def _zipped(path: Path) -> Iterator[MitFile]:
    names = sorted(place.member for place in mit_places(path) if place.member is not None)
    if not names:
        raise ImportSourceError(f"{path}: the archive contains no {', '.join(SUFFIXES)} file")
    yield from _members(path, names)


def _members(path: Path, names: Sequence[str]) -> Iterator[MitFile]:
    with _archive(path) as archive:
        for name in names:
            yield MitFile(f"{path}/{name}", archive.read(name), alone=False)


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
