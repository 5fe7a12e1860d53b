# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residuals of an open validation as a table on disk: what remains of it if the process is killed."""

from __future__ import annotations

from pathlib import Path

from push_predictor.recordings.atomic import append_lines
from push_predictor.recordings.table import COLUMNS, OUTPUTS
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array

JOURNAL = "residuals.csv"  # exists while a validation is open, and after one that was interrupted
_PREDICTED = tuple(f"predicted_{name}" for name in OUTPUTS)
_COVARIANCE = tuple(f"covariance_{first}_{second}" for first in OUTPUTS for second in OUTPUTS)
HEADER = (*COLUMNS, "model", "window", "end", *_PREDICTED, *_COVARIANCE)


class ResidualJournal:
    """FOLDER/residuals.csv: a push table of the predicted windows, with the model and its prediction.

    Every prediction is appended as soon as it arrives, as a whole line.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / JOURNAL
        self.failure = ""  # why no more residuals are saved, in words

    def begin(self) -> None:
        """Write the empty table, which marks an open validation. Raises OSError that names the path."""
        self.path.unlink(missing_ok=True)
        append_lines(self.path, [",".join(HEADER)])

    def add(self, model: str, window: PushWindow, mean: Array, covariance: Array) -> None:
        """Append a prediction (3,), (3, 3). A full disk does not end the measurement: see `failure`."""
        if self.failure:
            return
        inputs = (window.velocity, window.contact, window.angle, window.duration)
        cells = [
            *map(repr, map(float, (*inputs, *window.displacement))),
            window.push_id,
            *(_quoted(model), str(window.index), str(window.end)),
            *map(repr, (*mean.tolist(), *covariance.ravel().tolist())),
        ]
        try:
            append_lines(self.path, [",".join(cells)])
        except OSError as error:
            self.failure = f"Residuals are no longer saved: {error}"


def _quoted(text: str) -> str:
    """A cell of a CSV file: a server may give its models any name."""
    return '"' + text.replace('"', '""') + '"'
