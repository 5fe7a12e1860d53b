# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of the table of measured windows of a pushed square (`mit_square`).

The source has contact c on one side (0..1), dy positive to the right of the push, 20 mm/s and windows of 0.2 s.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import MASSES, shape_outline
from push_predictor.recordings.importers.mit import PUSHER_RADIUS
from push_predictor.recordings.importers.staging import ImportReport, Notes, Staging, safe_name
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import finite_column, sheet_of
from push_predictor.types import Array

VELOCITY = 0.02  # m/s
DURATION = 0.2  # s
EDGE = 0
COLUMNS = ("c", "beta", "dx", "dy", "dtheta", "push_group_est", "row_id")
CSV_NAMES = {"beta": "beta_rad", "dx": "dx_m", "dy": "dy_m", "dtheta": "dtheta_rad"}
ASSUMED = (
    f"every window: pusher {VELOCITY} m/s, duration {DURATION} s, edge {EDGE} of rect1 (none of these in the source)",
    "the sign of dy is reversed: in the source it is positive to the right of the push",
    "push_id is the source's estimate push_group_est",
    f"pusher radius {PUSHER_RADIUS} m, mass {MASSES['rect1']} kg, surface unknown",
)


def import_mit_square(sources: Sequence[Path], staging: Staging, rig: Rig | None = None) -> ImportReport:
    """NAME.csv and NAME.rig.yaml for each .npz or .csv[.gz].

    Raises ImportSourceError with line or array index.
    """
    notes = Notes(assumed=list(ASSUMED))
    for source in staging.in_turn(sources):
        name = safe_name(source.name.split(".")[0])
        used = rig or square_rig()
        staging.table(name, read_mit_square(source, used.outline), used)
    return staging.report("mit-square", notes)


def square_rig() -> Rig:
    """The square of the MIT set; the source does not state its surface."""
    return Rig("rect1", shape_outline("rect1"), PUSHER_RADIUS, "unknown", MASSES["rect1"])


def read_mit_square(source: Path, outline: Outline) -> PushTable:
    """The rows as a push table, with row_id as a covariate."""
    columns = _columns(source)
    c = columns["c"]
    if np.any(bad := (c < 0.0) | (c > 1.0)):
        row = int(np.argmax(bad))
        raise ImportSourceError(f"{source}: c[{row}] is {float(c[row])!r}, give a fraction of the side, 0 to 1")
    rows = len(c)
    return PushTable(
        np.column_stack([np.full(rows, VELOCITY), outline.contact_on_edge(EDGE, c), columns["beta"]]),
        np.full(rows, DURATION),
        np.column_stack([columns["dx"], -columns["dy"], columns["dtheta"]]),
        np.array([str(int(group)) for group in columns["push_group_est"]]),
        {"row_id": columns["row_id"]},
    )


def _columns(source: Path) -> dict[str, Array]:
    if not source.is_file():
        raise ImportSourceError(f"{source}: is not a file, give pushes_*.npz or pushes_*.csv[.gz]")
    if source.name.endswith(".npz"):
        return _npz_columns(source)
    if source.name.endswith((".csv", ".csv.gz")):
        return _csv_columns(source)
    raise ImportSourceError(f"{source}: suffix {source.suffix!r}, give .npz, .csv or .csv.gz")


def _npz_columns(source: Path) -> dict[str, Array]:
    try:
        with np.load(source, allow_pickle=False) as arrays:
            if missing := [name for name in COLUMNS if name not in arrays]:
                raise ImportSourceError(f"{source}: lacks {', '.join(missing)}; it contains {', '.join(arrays)[:200]}")
            columns = {name: np.asarray(arrays[name], dtype=np.float64) for name in COLUMNS}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise ImportSourceError(f"{source}: the npz file cannot be read ({error})") from None
    for name, column in columns.items():
        if column.shape != columns["c"].shape or column.ndim != 1:
            raise ImportSourceError(f"{source}: {name} has shape {column.shape}, c has {columns['c'].shape}")
        if np.any(bad := ~np.isfinite(column)):
            row = int(np.argmax(bad))
            raise ImportSourceError(f"{source}: {name}[{row}] is {float(column[row])!r}, give a finite number")
    return columns


def _csv_columns(source: Path) -> dict[str, Array]:
    names = {name: CSV_NAMES.get(name, name) for name in COLUMNS}
    sheet = sheet_of(source, list(names.values()), ImportSourceError)
    return {name: finite_column(sheet, column) for name, column in names.items()}
