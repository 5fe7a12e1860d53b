# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator keeps on disk while a run is open, so that an interrupted one loses nothing.

Every window is appended with its covariates to the table that a residual trace starts from as soon as it is found, and
every prediction to the journal of the residuals.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime, timezone
from pathlib import Path
from types import MappingProxyType

import numpy as np

from push_predictor.recordings.atomic import append_lines, write_whole
from push_predictor.recordings.rig import Rig, save_rig
from push_predictor.recordings.table import COLUMNS, OUTPUTS
from push_predictor.recordings.table_file import rig_path
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array

TABLE = "pushes.csv"
JOURNAL = "residuals.csv"  # exists while a validation is open, and after one that was interrupted
_PREDICTED = tuple(f"predicted_{name}" for name in OUTPUTS)
_COVARIANCE = tuple(f"covariance_{first}_{second}" for first in OUTPUTS for second in OUTPUTS)
HEADER = (*COLUMNS, "model", "window", "end", *_PREDICTED, *_COVARIANCE)
NOTHING: Mapping[str, float] = MappingProxyType({})


class RunFiles:
    """FOLDER/pushes.csv and its rig file, and the journal FOLDER/residuals.csv, begun with the first window.

    The journal is a push table of the predicted windows, with the model and its prediction. Lines are appended as a
    whole. path: of the push table. failure: why nothing more is saved, in words; a full disk does not end the
    measurement. cut_off: folder that an earlier, interrupted validation was moved to.
    """

    def __init__(self, folder: Path, rig: Rig) -> None:
        self.path, self._journal, self._rig = folder / TABLE, folder / JOURNAL, rig
        self._names: tuple[str, ...] | None = None
        self.failure = ""
        self.cut_off: Path | None = None

    def add(
        self, windows: Sequence[PushWindow], before: Sequence[PushWindow], first: Mapping[str, float] = NOTHING
    ) -> None:
        """Append windows; `before` are all those that are in the file.

        first: first value of each scalar topic, which windows before it get, as when a recording is read; without one
        NaN.
        """
        if not windows or self.failure:
            return
        names = tuple(dict.fromkeys(name for window in windows for name in window.covariates))
        with self._saving():
            if self._names is None or not set(names) <= set(self._names):
                self._begin(tuple(dict.fromkeys([*(self._names or ()), *names])), before, first)
            append_lines(self.path, self._rows(windows, first))

    def add_residual(self, model: str, window: PushWindow, mean: Array, covariance: Array) -> None:
        """Append a prediction (3,), (3, 3)."""
        if self.failure:
            return
        numbers = map(repr, (*mean.tolist(), *covariance.ravel().tolist()))
        cells = [*_cells(window), _quoted(model), str(window.index), str(window.end), *numbers]
        with self._saving():
            append_lines(self._journal, [",".join(cells)])

    @contextmanager
    def _saving(self) -> Iterator[None]:
        """Keep a failure, after which nothing is written: a table with a gap would be no table of the run."""
        try:
            yield
        except OSError as error:
            self.failure = f"Windows and residuals are no longer saved: {error}"

    def _begin(self, names: tuple[str, ...], before: Sequence[PushWindow], first: Mapping[str, float]) -> None:
        if self._names is None:
            self.cut_off = put_aside(self.path.parent)
            self._journal.unlink(missing_ok=True)
            append_lines(self._journal, [",".join(HEADER)])
        self._names = names
        lines = [",".join([*COLUMNS, *names]), *self._rows(before, first)]
        write_whole(self.path, (f"{line}\n".encode() for line in lines))
        save_rig(self._rig, rig_path(self.path))

    def _rows(self, windows: Sequence[PushWindow], first: Mapping[str, float]) -> Iterator[str]:
        for window in windows:
            covariates = (window.covariates.get(name, first.get(name, np.nan)) for name in self._names or ())
            yield ",".join([*_cells(window), *map(repr, map(float, covariates))])


def put_aside(folder: Path) -> Path | None:
    """Move the windows and residuals of an interrupted validation to FOLDER/cut_off_DATE, so that they are kept.

    DATE is that of the last residual, UTC. Returns None if there is no such validation. Raises OSError.
    """
    journal = folder / JOURNAL
    if not journal.exists():
        return None
    date = datetime.fromtimestamp(journal.stat().st_mtime, timezone.utc)
    place = folder / f"cut_off_{date:%Y%m%dT%H%M%S%f}"
    place.mkdir(exist_ok=True)
    for path in (folder / TABLE, rig_path(folder / TABLE), journal):  # the journal last: it marks the interruption
        if path.exists():
            path.replace(place / path.name)
    return place


def _cells(w: PushWindow) -> list[str]:
    """Those of COLUMNS."""
    numbers = (w.velocity, w.contact, w.angle, w.duration, *w.displacement.tolist())
    return [*map(repr, map(float, numbers)), w.push_id]


def _quoted(text: str) -> str:
    """A cell of a CSV file: a server may give its models any name."""
    return '"' + text.replace('"', '""') + '"'
