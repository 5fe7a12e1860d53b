# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The windows and predictions of a validation run, and the files written about them."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from push_predictor.evaluation.validation import Comparison, comparison_of, metrics_json
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.online.files.row_file import RowFile
from push_predictor.online.files.window_log import Refusal, write_window_log
from push_predictor.online.files.window_rows import WindowRows
from push_predictor.online.running_score import RunningScore
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table
from push_predictor.types import Array, BoolArray, IntArray

MAIN_RESULT = "validation.json"
_ANSWER = struct.Struct("<q12d?")  # number of the window, mean, covariance, whether in the domain
_ROW = np.dtype([("number", "<i8"), ("values", "<f8", 12), ("in_domain", "?")])  # the same
_NUMBER = struct.Struct("<q")


class Residual(NamedTuple):
    """A predicted window: model name, window, mean (3,), covariance (3, 3), whether in the model's domain."""

    model: str
    window: PushWindow
    mean: Array
    covariance: Array
    in_domain: bool


class LiveValidation:
    """Windows in the order they were found, and the predictions of each model in any order.

    models: by the name to request; the first is the main one, and a model's number is its position. All windows and
    predictions are stored in temporary files: a window takes some twenty bytes of memory until the result is written.
    """

    def __init__(self, models: Mapping[str, PushModel]) -> None:
        self.names, self.models = tuple(models), tuple(models.values())
        self.windows = WindowRows()
        self.scores = tuple(RunningScore(model.training_mean, model.predictor.tails) for model in self.models)
        self._answers = tuple(_Answers() for _ in self.models)
        self._refused = tuple(RowFile() for _ in self.models)

    def add(self, window: PushWindow) -> int:
        """Add a window; returns its number."""
        self.windows.append(window)
        return len(self.windows) - 1

    def record(self, model: int, number: int, prediction: Prediction) -> None:
        """Record a model's prediction (n = 1) of a window; once for each."""
        window, mean, covariance = self.windows[number], prediction.mean[0], prediction.covariance[0]
        self._answers[model].add(number, mean, covariance, bool(prediction.in_domain[0]))
        self.scores[model].add(window.push_id, mean, covariance, window.displacement)

    def refuse(self, model: int, number: int, reason: str) -> None:
        """Record that a model was refused a window, and why."""
        self._refused[model].append(_NUMBER.pack(number) + reason.encode())

    def predicted(self, model: int = 0) -> WindowRows:
        """The windows that a model has predicted, in order."""
        return self.windows.take(self._answers[model].sorted()[0])

    def refused(self, model: int = 0) -> list[Refusal]:
        """The windows that a model was refused, in order."""
        pairs = sorted((*_NUMBER.unpack_from(row), row[_NUMBER.size :].decode()) for row in self._refused[model])
        return [Refusal(self.windows[k].push_id, self.windows[k].index, reason) for k, reason in pairs]

    def unanswered(self, model: int = 0) -> int:
        """How many windows were neither predicted nor refused."""
        return len(self.windows) - len(self._answers[model]) - len(self._refused[model])

    def comparison(self, model: int = 0) -> Comparison:
        """Predicted and observed outcomes of the windows that a model has predicted."""
        numbers, mean, covariance, _ = self._answers[model].sorted()
        table = self.models[model].continued(windows_to_table(self.windows.take(numbers)))
        return comparison_of(self.models[model], table, mean, covariance)

    def residuals(self) -> Iterator[Residual]:
        """Every prediction, in the order of the windows."""
        answers = [zip(*stored.sorted(), strict=True) for stored in self._answers]
        rows = [(number, k, *rest) for k, each in enumerate(answers) for number, *rest in each]
        for number, k, mean, covariance, in_domain in sorted(rows, key=lambda row: row[:2]):
            yield Residual(self.names[k], self.windows[number], mean, covariance, bool(in_domain))

    def write(self, folder: Path) -> list[Path]:
        """Write validation.json of the main model, validation_NAME.json of the others, and their windows one by one.

        Raises OSError.
        """
        folder.mkdir(parents=True, exist_ok=True)
        return [self._write(folder, k) for k in range(len(self.models))]

    def _write(self, folder: Path, model: int) -> Path:
        suffix = f"_{_file_name(self.names[model])}" if model else ""
        comparison, path = self.comparison(model), folder / MAIN_RESULT.replace(".json", f"{suffix}.json")
        windows, refused = self.predicted(model), self.refused(model)
        write_window_log(folder / f"windows{suffix}.json", windows, comparison, refused, self.unanswered(model))
        write_whole(path, (json.dumps(metrics_json(comparison), indent=2, allow_nan=False) + "\n").encode())
        return path


class _Answers:
    """Means, covariances and whether in the domain, by number of window, packed."""

    def __init__(self) -> None:
        self._rows = RowFile()

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, number: int, mean: Array, covariance: Array, in_domain: bool) -> None:
        self._rows.append(_ANSWER.pack(number, *mean.tolist(), *covariance.ravel().tolist(), in_domain))

    def sorted(self) -> tuple[IntArray, Array, Array, BoolArray]:
        """Numbers (n,), means (n, 3), covariances (n, 3, 3), whether in the domain (n,), by number."""
        data = np.frombuffer(b"".join(self._rows), dtype=_ROW)
        data = data[np.argsort(data["number"])]
        values = data["values"]
        mean, covariance = values[:, :3].copy(), values[:, 3:].reshape(-1, 3, 3).copy()
        return data["number"].copy(), mean, covariance, data["in_domain"].copy()


def _file_name(name: str) -> str:
    """A model's name as part of a file name: a server may give its models any name."""
    return re.sub(r"[^\w.-]", "_", name)
