# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Load recordings and push tables to judge a model on, with every covariate that an effect may depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.models.effects.covariates import CUMULATIVE
from push_predictor.models.effects.traced_session import COUNT, DISTANCE, TIME, Mark, TracedSession, beginnings
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.load import Inspect, distinct_pushes, load_recording, load_rig_for, no_inspection
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import INPUTS, PushTable, concatenate, empty_table
from push_predictor.recordings.table_file import is_recording, read_table
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions, windows_to_table
from push_predictor.residuals.evidence.standardised import push_order
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class LoadedData:
    """Windows in order of time, the recordings they were cut from, and the rig.

    recordings: None where a push table was given. dropped: covariates that some rows lack, each with the reason.
    session: that these data are.
    """

    table: PushTable
    recordings: tuple[Recording, ...] | None
    rig: Rig
    dropped: dict[str, str] = field(default_factory=dict)
    session: TracedSession = field(default_factory=TracedSession)


def load_evidence(
    paths: Sequence[Path],
    rig: Rig | None = None,
    options: WindowOptions = WindowOptions(),
    *,
    topics: Topics = Topics(),
    inspect: Inspect = no_inspection,
) -> LoadedData:
    """Load recordings and push tables; rig and topics override theirs.

    inspect: called with each path, its data and the rig. Raises RecordingError (also if no file contains a window),
    TableError or RigError.
    """
    every = [Path(path) for path in paths]
    alone = len(every) == 1 and is_recording(every[0])  # its rig is read with it: to open a long bag takes seconds
    rig = rig or (None if alone else load_rig_for(every))
    bags = sorted((load_recording(p, rig, topics, inspect) for p in every if is_recording(p)), key=_first_stamp)
    rig = rig or require_rig(bags[0])
    tables = [(path.name, _read(path, rig, inspect)) for path in every if not is_recording(path)]
    found = _loaded(bags, tables, rig, options)
    if not len(found.table):
        raise RecordingError(f"{', '.join(map(str, every))}: no push was found, give recordings of pushes")
    return found


def cut_again(recordings: Sequence[Recording], rig: Rig, options: WindowOptions = WindowOptions()) -> PushTable:
    """Cut the windows of recordings, in order of time, after a correction of their streams or the rig."""
    return _loaded(recordings, [], rig, options).table


def with_inputs(table: PushTable) -> PushTable:
    """The table with the model's inputs among its covariates: an effect may depend on them too."""
    inputs = dict(zip(INPUTS, table.inputs.T, strict=True))
    return replace(table, covariates={**table.covariates, **inputs})


def _loaded(
    recordings: Sequence[Recording], files: Sequence[tuple[str, PushTable]], rig: Rig, options: WindowOptions
) -> LoadedData:
    """Recordings in order of time, then tables with their names."""
    names = [*(recording.name for recording in recordings), *(name for name, _ in files)]
    windows = [find_windows(recording, rig, options) for recording in recordings]
    own = [*map(_table, windows), *(table for _, table in files)]
    cut = [*map(_table, _continued(windows)), *(table for _, table in files)]
    kept = None if files else tuple(recordings)
    if not any(map(len, cut)):
        return LoadedData(empty_table(), kept, rig)
    table, dropped = _joined(distinct_pushes(names, cut))
    session = session_of([rows for rows in own if len(rows)], [rows for rows in cut if len(rows)])
    return LoadedData(table, kept, rig, dropped, session)


def _first_stamp(recording: Recording) -> int:
    return min((int(s.stamp[0]) for s in (recording.slider, recording.pusher) if len(s)), default=0)


def _table(windows: Sequence[PushWindow]) -> PushTable:
    return with_inputs(windows_to_table(windows))


def _continued(recordings: Sequence[Sequence[PushWindow]]) -> list[list[PushWindow]]:
    """Windows whose time, push count and distance continue from one recording to the next, by their stamps."""
    begin: int | None = None
    pushes, slid = 0.0, 0.0
    moved: list[list[PushWindow]] = []
    for windows in recordings:
        if not windows:
            moved.append([])
            continue
        own = windows[0].start - round(windows[0].covariates["elapsed_time"] / NANOSECOND)
        begin = own if begin is None else begin
        added = np.array([(own - begin) * NANOSECOND, pushes, slid])
        moved.append([_later(window, added) for window in windows])
        last = moved[-1][-1].covariates
        pushes = last["push_index"] + 1.0
        slid = last["slid_distance"] + float(np.hypot(*windows[-1].displacement[:2]))
    return moved


def _later(window: PushWindow, added: Array) -> PushWindow:
    later = {name: window.covariates[name] + float(more) for name, more in zip(CUMULATIVE, added, strict=True)}
    return replace(window, covariates={**window.covariates, **later})


def _read(path: Path, rig: Rig, inspect: Inspect) -> PushTable:
    rows = read_table(path)
    inspect(path, rows, rig)
    table = with_inputs(rows)
    edge = rig.outline.edge(table.inputs[:, 1])[0].astype(np.float64)
    return replace(table, covariates={"edge": edge, **table.covariates})


def _joined(tables: Sequence[PushTable]) -> tuple[PushTable, dict[str, str]]:
    """One table with the number of each row's recording, and the covariates that some rows lack."""
    numbered = [_numbered(number, table) for number, table in enumerate(tables) if len(table)]
    table = _indexed(concatenate(numbered))
    dropped = {}
    names = dict.fromkeys(name for part in numbered for name in part.covariates if name != "push_index")
    for name in names:
        having = sum(int(np.isfinite(part.covariates[name]).sum()) for part in numbered if name in part.covariates)
        if having < len(table):
            dropped[name] = f"{len(table) - having} of {len(table)} windows lack it"
    kept = {name: column for name, column in table.covariates.items() if name not in dropped}
    return replace(table, covariates=kept), dropped


def _indexed(table: PushTable) -> PushTable:
    """The table with a push index; counted in the order of the rows where none was recorded."""
    return replace(table, covariates={"push_index": push_order(table).astype(np.float64), **table.covariates})


def _numbered(number: int, table: PushTable) -> PushTable:
    """The table with the number of its recording, unless it has that column."""
    return replace(table, covariates={"recording": np.full(len(table), float(number)), **table.covariates})


def session_of(own: Sequence[PushTable], continued: Sequence[PushTable]) -> TracedSession:
    """The session of recordings or tables with rows, in order.

    own: with the cumulative covariates of each. continued: the same rows with those of the session.
    """
    names = [name for name in CUMULATIVE if all(name in table.covariates for table in continued)]
    now = {name: max(float(np.max(_afterwards(table, name))) for table in continued) for name in names}
    began = [beginnings(table) for table in own]
    if len(names) < len(CUMULATIVE) or not own or any(each is None for each in began):
        return TracedSession(now)
    marks = [
        Mark(int(begin[0]), *(float(later.covariates[k][0] - table.covariates[k][0]) for k in (COUNT, DISTANCE)))
        for begin, table, later in zip(began, own, continued, strict=True)
        if begin is not None
    ]
    ends = [
        int(np.max(begin + np.rint(_afterwards(table, TIME) / NANOSECOND).astype(np.int64)))
        for begin, table in zip(began, own, strict=True)
        if begin is not None
    ]
    marks.append(Mark(max(ends), now[COUNT], now[DISTANCE]))
    return TracedSession(now, marks[0].stamp, tuple(sorted(marks, key=lambda mark: mark.stamp)))


def _afterwards(table: PushTable, name: str) -> Array:
    """A cumulative covariate (n,) after each row: the values that the next push begins with."""
    added = {TIME: table.duration, COUNT: np.ones(len(table)), DISTANCE: np.hypot(*table.outcomes[:, :2].T)}
    return np.asarray(table.covariates[name] + added[name])
