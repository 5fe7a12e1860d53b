# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What all commands write and check before the work: JSON, files, warnings, paths."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from push_predictor.errors import RecordingError, RequestError
from push_predictor.recordings.atomic import write_whole


def write_json(options: argparse.Namespace, result: Mapping[str, object]) -> bool:
    """Write the result as JSON if asked; return True if it went to stdout, which then takes nothing else."""
    if options.json is None:
        return False
    text = json.dumps(result, indent=2, allow_nan=False)
    if options.json == "-":
        print(text)
        return True
    write_text(Path(options.json), text + "\n")
    return False


def write_text(path: Path, text: str) -> None:
    """Write a file; an older one is replaced only by a complete new one. Raises OSError that names the path."""
    write_whole(path, text.encode())


def warn(text: str) -> None:
    """Print a warning on stderr."""
    print(f"warning: {text}", file=sys.stderr)


def check_output(option: str, path: Path | None, *, force: bool, folder: bool = False) -> None:
    """Raise RequestError unless a file (or a folder) can be written there. Missing folders are created later.

    force: it may exist already. Without, only an empty file or folder may, and a device. Called before the work, so
    that hours of it are not lost at the end.
    """
    if path is None:
        return
    _check_place(option, path, folder)
    if not force and _has_content(path):
        accepted = f"another path, or --force to overwrite this {'folder' if folder else 'file'}"
        raise RequestError(option, str(path), accepted)


def check_folder(option: str, path: Path, outputs: Sequence[str] = (), *, force: bool) -> None:
    """Raise RequestError unless outputs can be added to a folder, which may exist; force: the outputs may exist."""
    _check_place(option, path, folder=True)
    for name in outputs:
        if not force and _has_content(path / name):
            raise RequestError(option, str(path), f"another folder, or --force to overwrite {name} in it")


def _has_content(path: Path) -> bool:
    return any(path.iterdir()) if path.is_dir() else path.is_file() and path.stat().st_size > 0


def _check_place(option: str, path: Path, folder: bool) -> None:
    """Raise RequestError unless a file (or a folder) can be created there."""
    if path.exists() and path.is_dir() != folder:
        accepted = "a folder: this is a file" if folder else "the path of a file: this is a folder"
        raise RequestError(option, str(path), accepted)
    places = [path.absolute(), *path.absolute().parents] if folder else path.absolute().parents
    place = next(place for place in places if place.exists())
    if not place.is_dir():
        raise RequestError(option, str(path), f"a path inside a folder: {place} is a file")
    if not os.access(place, os.W_OK | os.X_OK):
        raise RequestError(option, str(path), f"a path in a folder with write permission: {place} has none")


def check_data(paths: Sequence[Path]) -> None:
    """Raise RecordingError for a path that does not exist or is neither a recording nor a push table."""
    from push_predictor.recordings.table_file import ENDINGS, is_recording

    for path in paths:
        if not path.exists():
            raise RecordingError(f"{path}: no such file or folder")
        if not (is_recording(path) or path.name.endswith(ENDINGS)):
            accepted = "a recording (a folder, .mcap, .db3 or .bag) or a push table (.csv or .csv.gz)"
            raise RecordingError(f"{path}: give {accepted}")
