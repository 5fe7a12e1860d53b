"""The table of windows that a validator keeps on disk while pushes happen: what a trace of the residual starts from.

Every window is on disk as soon as it is found, with its covariates, whatever becomes of the validator.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.recordings.rig import Rig, save_rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import rig_path, write_table
from push_predictor.recordings.windows import PushWindow

TABLE = "pushes.csv"


class WindowTable:
    """FOLDER/pushes.csv and the rig beside it, anew with the first window that is added."""

    def __init__(self, folder: Path, rig: Rig) -> None:
        self.path, self._rig = folder / TABLE, rig
        self._names: tuple[str, ...] | None = None

    def add(self, windows: Sequence[PushWindow], before: Sequence[PushWindow]) -> None:
        """Append windows; `before` are all those that are in the file. Raises OSError that names the path."""
        if not windows:
            return
        names = tuple(dict.fromkeys(name for window in windows for name in window.covariates))
        try:
            if self._names is None or not set(names) <= set(self._names):
                self._begin(tuple(dict.fromkeys([*(self._names or ()), *names])), before)
            self._append(windows)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def _begin(self, names: tuple[str, ...], before: Sequence[PushWindow]) -> None:
        self._names = names
        write_table(self.path, _table(before, names))
        save_rig(self._rig, rig_path(self.path))

    def _append(self, windows: Sequence[PushWindow]) -> None:
        assert self._names is not None
        with self.path.open("a") as stream:
            stream.writelines(f"{','.join(_cells(window, self._names))}\n" for window in windows)


def _table(windows: Sequence[PushWindow], names: Sequence[str]) -> PushTable:
    """The windows as rows with just these covariates, NaN where a window lacks one."""
    return PushTable(
        np.array([[w.velocity, w.contact, w.angle] for w in windows]).reshape(-1, 3),
        np.array([w.duration for w in windows]),
        np.array([w.displacement for w in windows]).reshape(-1, 3),
        np.array([w.push_id for w in windows], dtype=np.str_),
        {name: np.array([w.covariates.get(name, np.nan) for w in windows]) for name in names},
    )


def _cells(w: PushWindow, names: Sequence[str]) -> list[str]:
    numbers = [w.velocity, w.contact, w.angle, w.duration, *w.displacement.tolist()]
    others = [w.covariates.get(name, float("nan")) for name in names]
    return [*map(repr, map(float, numbers)), w.push_id, *map(repr, map(float, others))]
