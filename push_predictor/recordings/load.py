# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Load recordings and push tables as one table and one rig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from push_predictor.errors import RecordingError, RigError
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.read import read_recording, recorded_rig, require_rig
from push_predictor.recordings.rig import HOW_TO_GIVE, RECORD_NAME, Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.recordings.table_file import is_recording, read_table, rig_of_table, rig_path
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import WindowOptions, windows_to_table
from push_predictor.types import Array

Inspect: TypeAlias = Callable[[Path, "Recording | PushTable", "Rig | None"], None]


def no_inspection(path: Path, data: Recording | PushTable, rig: Rig | None) -> None:
    """Accept the data of a path as they were read; in place of it, a caller may check them."""


def load_data(
    paths: Sequence[Path],
    rig: Rig | None = None,
    options: WindowOptions = WindowOptions(),
    *,
    numbered: bool = False,
    topics: Topics = Topics(),
    inspect: Inspect = no_inspection,
) -> PushTable:
    """The windows of all recordings and the rows of all tables, in the order given.

    rig replaces the recorded one; topics: of all recordings. inspect: called with each path, its data and its rig.
    numbered: add the covariate `recording`, the number of the path from 0. A covariate is kept if all data have it. If
    two paths use the same push_id for different rows, the name of the path is prefixed to it; the same rows twice
    remain one push. Raises RecordingError (also if no recording has a window), TableError or RigError.
    """
    tables = [_load(Path(path), rig, options, topics, inspect) for path in paths]
    if numbered:
        tables = [_numbered(number, table) for number, table in enumerate(tables)]
    if paths and not any(map(len, tables)):
        raise RecordingError(f"{', '.join(map(str, paths))}: no push was found, give recordings that contain pushes")
    names = [Path(path).name for path in paths]
    return concatenate([table for table in distinct_pushes(names, tables) if len(table)])


def load_rig_for(paths: Sequence[Path]) -> Rig:
    """The rig of the data, from the recordings and the tables' NAME.rig.yaml.

    These must have the same outline and pusher. Raises RigError that names the path, the key and how to give it.
    """
    if not paths:
        raise RigError(f"{RECORD_NAME}: neither data nor a rig was given; {HOW_TO_GIVE}")
    first, *others = [(path, required_rig(Path(path))) for path in paths]
    for path, rig in others:
        if _geometry(rig) != _geometry(first[1]):
            raise RigError(f"{path}: outline or pusher ({rig.shape}) differ from {first[0]} ({first[1].shape})")
    return first[1]


def different_supports(paths: Sequence[Path]) -> dict[int, Array]:
    """Support points (k, 3) as in Rig, by number of the path, if the rigs of the paths differ in them; else empty.

    Paths without known support points are omitted.
    """
    rigs = [known_rig(Path(path)) for path in paths]
    found = [None if rig is None else rig.support_points for rig in rigs]
    if all(_same_support(points, found[0]) for points in found):
        return {}
    return {number: points for number, points in enumerate(found) if points is not None}


def distinct_pushes(names: Sequence[str], tables: Sequence[PushTable]) -> list[PushTable]:
    """The tables; if a push_id occurs with different rows in two of them, all get their names as prefix."""
    seen: dict[str, bytes] = {}
    for table in tables:
        for push, rows in _rows_by_push(table).items():
            if seen.setdefault(push, rows) != rows:
                return [_prefixed(table, name) for name, table in zip(names, tables, strict=True)]
    return list(tables)


def _load(path: Path, rig: Rig | None, options: WindowOptions, topics: Topics, inspect: Inspect) -> PushTable:
    if not is_recording(path):
        table = read_table(path)
        inspect(path, table, rig)
        return table
    recording = load_recording(path, rig, topics, inspect)
    return windows_to_table(find_windows(recording, require_rig(recording), options))


def load_recording(path: Path, rig: Rig | None, topics: Topics, inspect: Inspect) -> Recording:
    """A recording that was inspected. Raises RecordingError, and RigError without a rig."""
    recording = read_recording(path, rig=rig, topics=topics)
    inspect(path, recording, require_rig(recording))
    return recording


def known_rig(path: Path) -> Rig | None:
    """The rig of a recording or of a table, None without one."""
    return recorded_rig(open_bag(path)) if is_recording(path) else rig_of_table(path)


def required_rig(path: Path) -> Rig:
    """The rig of a recording or of a table. Raises RigError without one."""
    if (rig := known_rig(path)) is None:
        place = "the recording" if is_recording(path) else str(rig_path(path))
        raise RigError(f"{path}: no {RECORD_NAME} in {place}; {HOW_TO_GIVE}")
    return rig


def _geometry(rig: Rig) -> tuple[str | None, ...]:
    record = rig.to_record()
    return tuple(record.get(key) for key in ("outline", "shape_parameters", "pusher_radius"))


def _same_support(one: Array | None, other: Array | None) -> bool:
    return one is other or (one is not None and other is not None and np.array_equal(one, other))


def _numbered(number: int, table: PushTable) -> PushTable:
    return replace(table, covariates={**table.covariates, "recording": np.full(len(table), float(number))})


def _rows_by_push(table: PushTable) -> dict[str, bytes]:
    rows = np.column_stack([table.inputs, table.duration, table.outcomes])
    order = np.argsort(table.push_id, kind="stable")
    names, starts = np.unique(table.push_id[order], return_index=True)
    parts = np.split(rows[order], starts[1:])
    return {str(name): part.tobytes() for name, part in zip(names, parts, strict=True)}


def _prefixed(table: PushTable, name: str) -> PushTable:
    ids = np.array([f"{name}/{push}" for push in table.push_id.tolist()], dtype=np.str_)
    return replace(table, push_id=ids)
