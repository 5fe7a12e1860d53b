"""The residuals that a validator leaves: a bag of push_residual, with the scalars of the windows; until that is written
a table of them, which is on disk as they come.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rclpy.serialization import serialize_message

from msg_adapters.residual_schema import RESIDUAL_DEFINITION, RESIDUAL_TYPE
from msg_adapters.residuals import ValidatedWindow, residual_to_message
from push_predictor.online.live_validation import LiveValidation
from push_predictor.recordings.atomic_append import append_lines
from push_predictor.recordings.bag.cdr import encode
from push_predictor.recordings.bag.definitions import FLOAT64, SCALAR_LAYOUTS
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.table import COLUMNS
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushResidual

TOPIC = "push_residual"
BAG = "residuals"
SCALAR = "topic:"  # begins the name of a scalar topic's covariate
JOURNAL = "residuals.csv"  # is there while a score is open, and after one that was cut off
_AXES = ("dx", "dy", "dtheta")
_ADDED = (
    *("model", "window", "end"),
    *(f"predicted_{name}" for name in _AXES),
    *(f"covariance_{first}_{second}" for first in _AXES for second in _AXES),
)


def write_residuals(validation: LiveValidation, folder: Path) -> Path:
    """Write FOLDER/residuals, a rosbag2 folder with a message for every answer, and one for every scalar of a window at
    its start; the journal of these answers goes. Raises RecordingError.
    """
    path = folder / BAG
    names = dict.fromkeys(
        name for window in validation.windows for name in window.covariates if name.startswith(SCALAR)
    )
    with BagWriter(path) as bag:
        bag.add_topic(TOPIC, RESIDUAL_TYPE, RESIDUAL_DEFINITION)
        for name in names:
            bag.add_topic(name.removeprefix(SCALAR), FLOAT64.name, FLOAT64.definition, type_hash=FLOAT64.type_hash)
        for time, topic, data in heapq.merge(
            _residuals(validation), _scalars(validation), key=lambda message: message[0]
        ):
            bag.write(topic, time, data)
    (folder / JOURNAL).unlink(missing_ok=True)
    return path


class ResidualJournal:
    """FOLDER/residuals.csv: a push table of the windows that were answered, with the model and what it predicted.

    Every answer is on disk as soon as it is there, in whole lines, whatever becomes of the validator.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / JOURNAL
        self.failure = ""  # why no more is kept, in words

    def begin(self) -> None:
        """The empty table, which says that a score is open. Raises OSError that names the path."""
        self.path.unlink(missing_ok=True)
        append_lines(self.path, [",".join((*COLUMNS, *_ADDED))])

    def add(self, residual: PushResidual) -> None:
        """Append an answer; that the disk takes no more does not end the measurement."""
        if self.failure:
            return
        stamp = residual.header.stamp
        added = [_quoted(residual.model), residual.window, stamp.sec * 10**9 + stamp.nanosec]
        inputs = (residual.velocity, residual.contact, residual.angle, residual.duration)
        numbers = [*residual.observed.tolist(), *residual.predicted.tolist(), *residual.covariance.tolist()]
        cells = [*map(repr, (*inputs, *numbers[:3])), residual.push_id, *map(str, added), *map(repr, numbers[3:])]
        try:
            append_lines(self.path, [",".join(cells)])
        except OSError as error:
            self.failure = f"residuals are not kept: {error}"


def _quoted(text: str) -> str:
    """A cell of a CSV: a server may call its models anything."""
    return '"' + text.replace('"', '""') + '"'


def _residuals(validation: LiveValidation) -> Iterator[tuple[int, str, bytes]]:
    for model, window, mean, covariance in validation.residuals():
        yield window.end, TOPIC, serialize_message(residual_message(model, window, mean, covariance))


def _scalars(validation: LiveValidation) -> Iterator[tuple[int, str, bytes]]:
    for window in validation.windows:
        for name, value in window.covariates.items():
            if name.startswith(SCALAR):
                row = np.array([[value]])
                (data,) = encode(np.array([window.start]), row, SCALAR_LAYOUTS[FLOAT64.name])
                yield window.start, name.removeprefix(SCALAR), data


def residual_message(model: str, window: PushWindow, mean: Array, covariance: Array) -> PushResidual:
    """A window and its prediction (3,), (3, 3). Raises MessageError for a covariance that is not positive definite."""
    inputs = np.array([window.velocity, window.contact, window.angle])
    observed, name = window.displacement, window.push_id
    return residual_to_message(
        ValidatedWindow(window.end, name, window.index, model, inputs, window.duration, mean, covariance, observed)
    )
