# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push tables as CSV, also .csv.gz (docs/reference/recordings.md)."""

from __future__ import annotations

import csv
import gzip
import io
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from push_predictor.errors import TableError
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.bag.reader import is_bag_file
from push_predictor.recordings.bag.spreadsheet import ERRORS, cells_of
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
    path = Path(path)
    columns, lines = read_cells(path, COLUMNS)
    numbers = {name: finite_column(path, name, columns[name], lines) for name in NUMBERS}
    others = [name for name in columns if name not in COLUMNS]
    covariates = {name: _covariate(path, name, columns[name], lines) for name in others}
    return PushTable(
        inputs=np.stack([numbers[name] for name in INPUTS], axis=1),
        duration=numbers["duration"],
        outcomes=np.stack([numbers[name] for name in OUTPUTS], axis=1),
        push_id=_push_ids(path, columns["push_id"], lines),
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


def read_cells(path: Path, required: Sequence[str]) -> tuple[dict[str, tuple[str, ...]], list[int]]:
    """The cells of each column of a CSV by its name, and the line number of each row. Raises TableError."""
    try:
        data = path.read_bytes()
        found = cells_of(gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data)
    except (*ERRORS, EOFError) as error:
        raise TableError(f"{path}: cannot be read as CSV ({error})") from None
    if len(found) < 2:
        raise TableError(f"{path}: contains no rows, give a header with {', '.join(required)} and one row per push")
    lower = {name.lower(): name for name in required}
    header = [lower.get(name.lower(), name) for name in found[0][1]]
    if len(set(header)) != len(header):
        raise TableError(f"{path} line 1: a column occurs twice in {', '.join(header)!r}")
    if missing := [name for name in required if name not in header]:
        raise TableError(f"{path} line 1: lacks column {', '.join(missing)}, it has {', '.join(header)!r}")
    for line, row in found[1:]:
        if len(row) != len(header):
            raise TableError(f"{path} line {line}: {len(row)} cells, the header has {len(header)}")
    lines, rows = zip(*found[1:], strict=True)
    return dict(zip(header, zip(*rows, strict=True), strict=True)), list(lines)


def finite_column(path: Path, name: str, cells: Sequence[str], lines: Sequence[int]) -> Array:
    """The numbers (n,) of a column. Raises TableError with the line of one that is not accepted."""
    accepted, test = ACCEPTED.get(name, ("a finite number", np.isfinite))
    values = np.array([_number(cell) for cell in cells])
    with np.errstate(invalid="ignore"):
        wrong = np.flatnonzero(~(np.isfinite(values) & test(values)))
    if len(wrong):
        raise _wrong(path, lines[wrong[0]], name, cells[wrong[0]], accepted)
    return values


def _covariate(path: Path, name: str, cells: Sequence[str], lines: Sequence[int]) -> Array | None:
    values = np.array([_number(cell) for cell in cells])
    words = [i for i, cell in enumerate(cells) if cell and np.isnan(values[i]) and cell.lower() != "nan"]
    given = sum(1 for cell in cells if cell)
    if len(words) == given:
        return None
    if words:
        raise _wrong(path, lines[words[0]], name, cells[words[0]], "a number, or leave it empty")
    return values


def _push_ids(path: Path, cells: Sequence[str], lines: Sequence[int]) -> TextArray:
    for line, cell in zip(lines, cells, strict=True):
        if not cell:
            raise _wrong(path, line, "push_id", cell, "a name, the same for all windows of one push")
    return np.array(cells, dtype=np.str_)


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return float("nan")


def _wrong(path: Path, line: int, column: str, value: str, accepted: str) -> TableError:
    return TableError(f"{path} line {line}: column {column} is {value!r}, give {accepted}")
