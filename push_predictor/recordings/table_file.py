# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push tables as CSV, also .csv.gz (docs/reference/recordings.md)."""

from __future__ import annotations

import csv
import gzip
import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from push_predictor.errors import PushPredictorError, TableError
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.bag.reader import is_bag_file
from push_predictor.recordings.bag.spreadsheet import Sheet, read_sheet
from push_predictor.recordings.rig import Rig, load_rig
from push_predictor.recordings.table import COLUMNS, INPUTS, OUTPUTS, PushTable
from push_predictor.types import Array, BoolArray, TextArray

ENDINGS = (".csv.gz", ".csv")
NUMBERS = tuple(name for name in COLUMNS if name != "push_id")
ACCEPTED: dict[str, tuple[str, Callable[[Array], BoolArray]]] = {
    "velocity": ("a number above 0, m/s", lambda v: v > 0.0),
    "contact": ("a number from 0 to below 1", lambda v: (v >= 0.0) & (v < 1.0)),
    "angle": ("a number above -pi/2 and below pi/2, rad", lambda v: np.abs(v) < np.pi / 2.0),
    "duration": ("a number above 0, s", lambda v: v > 0.0),
}


def read_table(path: Path) -> PushTable:
    """Read a CSV with the columns velocity, contact, angle, duration, dx, dy, dtheta, push_id.

    A further column of numbers becomes a covariate (an empty cell is NaN, unknown); a column of text is ignored.
    Raises TableError that names file, line, column, value and what is accepted.
    """
    sheet = sheet_of(Path(path), COLUMNS, TableError)
    numbers = {name: finite_column(sheet, name) for name in NUMBERS}
    covariates = {name: _covariate(sheet, place) for place, name in enumerate(sheet.header) if name not in COLUMNS}
    return PushTable(
        inputs=np.stack([numbers[name] for name in INPUTS], axis=1),
        duration=numbers["duration"],
        outcomes=np.stack([numbers[name] for name in OUTPUTS], axis=1),
        push_id=_push_ids(sheet),
        covariates={name: column for name, column in covariates.items() if column is not None},
    )


def write_table(path: Path, table: PushTable) -> None:
    """Write a CSV, gzip if path ends in .gz, that reads back to the same numbers.

    The same table gives the same bytes. An earlier file is replaced when the new one is complete. Raises OSError that
    names the path.
    """
    path = Path(path)
    columns = [*table.inputs.T, table.duration, *table.outcomes.T]
    columns += table.covariates.values()
    numbers = [[repr(value) for value in column.tolist()] for column in columns]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*COLUMNS, *table.covariates])
    writer.writerows(zip(*numbers[:7], table.push_id.tolist(), *numbers[7:], strict=True))
    data = text.getvalue().encode()
    write_whole(path, gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)


def is_recording(path: Path) -> bool:
    """Whether a path is a recording (a folder, .mcap, .db3 or .bag) and not a push table."""
    return Path(path).is_dir() or is_bag_file(Path(path))


def rig_path(path: Path) -> Path:
    """NAME.rig.yaml for NAME.csv or NAME.csv.gz."""
    name = Path(path).name
    stem = next((name[: -len(ending)] for ending in ENDINGS if name.endswith(ending)), Path(path).stem)
    return Path(path).with_name(f"{stem}.rig.yaml")


def rig_of_table(path: Path) -> Rig | None:
    """The rig in NAME.rig.yaml for NAME.csv, None without this file. Raises RigError if it is invalid."""
    return load_rig(file) if (file := rig_path(path)).exists() else None


def sheet_of(path: Path, required: Sequence[str], error: type[PushPredictorError]) -> Sheet:
    """A CSV that has at least these columns, each once, in any case. Raises `error`."""
    sheet = read_sheet(path, error)
    lower = {name.lower(): name for name in required}
    header = [lower.get(name.lower(), name) for name in sheet.header]
    if len(set(header)) != len(header):
        raise error(f"{path} line 1: a column occurs twice in {', '.join(header)!r}")
    if missing := [name for name in required if name not in header]:
        raise error(f"{path} line 1: lacks column {', '.join(missing)}, it has {', '.join(header)!r}")
    return replace(sheet, header=header)


def finite_column(sheet: Sheet, name: str) -> Array:
    """The numbers (n,) of a column. Raises an error with the line of one that is not accepted."""
    accepted, test = ACCEPTED.get(name, ("a finite number", np.isfinite))
    place = sheet.header.index(name)
    values, _ = sheet.parsed(place)
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(~(np.isfinite(values) & test(values)))
    if len(wrong):
        raise sheet.wrong(int(wrong[0]), place, accepted)
    return values


def _covariate(sheet: Sheet, place: int) -> Array | None:
    """The numbers (n,) of a column, None if it contains only text."""
    _, words = sheet.parsed(place)
    return None if len(words) == sum(map(bool, sheet.cells(place))) else sheet.numbers(place)


def _push_ids(sheet: Sheet) -> TextArray:
    place = sheet.header.index("push_id")
    cells = sheet.cells(place)
    if "" in cells:
        raise sheet.wrong(cells.index(""), place, "a name, the same for all windows of one push")
    return np.array(cells, dtype=np.str_)
