# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The windows and predictions of a validation run, their running scores, and the files written about them."""

from __future__ import annotations

import json
import re
import signal
import sys
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isnan, nan
from pathlib import Path
from typing import NamedTuple, TypeAlias, overload

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.metrics import COVERAGE_LEVELS, coverage, gaussian_nlpd, standardised
from push_predictor.evaluation.offline import report_windows
from push_predictor.evaluation.validation import Comparison, comparison_of, metrics_json
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors.tails import Tails, half_widths
from push_predictor.models.push_model import PushModel
from push_predictor.online.alarm_process import CompletedPush
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.table import OUTPUTS
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table
from push_predictor.types import Array, BoolArray, IntArray

MAIN_RESULT = "validation.json"
WIDTH = 13  # numbers of an answer: mean, covariance, whether in the domain
_NO_ANSWER = array("d", [nan] * WIDTH)
_Row: TypeAlias = tuple[str, int, int, int, tuple[str, ...], bytes]  # names of covariates; all other numbers


class Residual(NamedTuple):
    """A predicted window: model name, window, mean (3,), covariance (3, 3), whether in the model's domain."""

    model: str
    window: PushWindow
    mean: Array
    covariance: Array
    in_domain: bool


@dataclass(frozen=True)
class Refusal:
    """A window that the server refused to predict, and its reason."""

    push_id: str
    window: int
    reason: str


class LiveValidation:
    """Windows in the order they were found, and the predictions of each model in any order.

    models: by the name to request; the first is the main one, and a model's number is its position.
    """

    def __init__(self, models: Mapping[str, PushModel]) -> None:
        self.names, self.models = tuple(models), tuple(models.values())
        self.windows = WindowRows()
        self.scores = tuple(RunningScore(model.training_mean, model.predictor.tails) for model in self.models)
        self._answers = tuple(_Answers() for _ in self.models)
        self._open: dict[str, list[int]] = {}  # numbers of the windows of the pushes that are not completed, in order

    def add(self, window: PushWindow) -> int:
        """Add a window; returns its number."""
        number = len(self.windows)
        self.windows.append(window)
        self._open.setdefault(window.push_id, []).append(number)
        for answers in self._answers:
            answers.expect()
        return number

    def record(self, model: int, number: int, prediction: Prediction) -> None:
        """Record a model's prediction (n = 1) of a window; once for each."""
        window = self.windows[number]
        self._answers[model].put(number, prediction)
        self.scores[model].add(window.push_id, prediction.mean[0], prediction.covariance[0], window.displacement)

    def refuse(self, model: int, number: int, reason: str) -> None:
        """Record that a model was refused a window, and why."""
        self._answers[model].refused[number] = reason

    def completed(self, last: bool = False) -> list[CompletedPush]:
        """The pushes since the last call whose windows the main model has all predicted or was refused.

        One is complete once another was found since; last: there will be neither windows nor answers.
        """
        done = []
        while self._open and (last or (len(self._open) > 1 and self._settled(next(iter(self._open.values()))))):
            numbers, mean, covariance, _ = self._answers[0].of(self._open.pop(next(iter(self._open))))
            if len(numbers):
                windows = self.windows.take(numbers)
                done.append(CompletedPush(windows_to_table(windows), mean, covariance, windows[-1].end))
        return done

    def _settled(self, numbers: Iterable[int]) -> bool:
        return all(self._answers[0].settled(number) for number in numbers)

    def predicted(self, model: int = 0) -> WindowRows:
        """The windows that a model has predicted, in order."""
        return self.windows.take(self._answers[model].predicted())

    def refused(self, model: int = 0) -> list[Refusal]:
        """The windows that a model was refused, in order."""
        pairs = sorted(self._answers[model].refused.items())
        return [Refusal(self.windows[k].push_id, self.windows[k].index, reason) for k, reason in pairs]

    def unanswered(self, model: int = 0) -> int:
        """How many windows were neither predicted nor refused."""
        return sum(not self._answers[model].settled(number) for number in range(len(self.windows)))

    def comparison(self, model: int = 0) -> Comparison:
        """Predicted and observed outcomes of the windows that a model has predicted."""
        numbers, mean, covariance, _ = self._answers[model].of(self._answers[model].predicted())
        table = self.models[model].continued(windows_to_table(self.windows.take(numbers)))
        return comparison_of(self.models[model], table, mean, covariance)

    def reported(self) -> tuple[list[PushModel], WindowRows, list[Comparison]]:
        """What `write_report` takes: the models that have predicted the same windows as the main one."""
        comparisons = [self.comparison(k) for k in range(len(self.models))]
        whole = [k for k, c in enumerate(comparisons) if np.array_equal(c.observed, comparisons[0].observed)]
        return [self.models[k] for k in whole], self.predicted(), [comparisons[k] for k in whole]

    def residuals(self) -> Iterator[Residual]:
        """Every prediction, in the order of the windows."""
        for number, window in enumerate(self.windows):
            for name, answers in zip(self.names, self._answers, strict=True):
                for mean, covariance, in_domain in zip(*answers.of([number])[1:], strict=True):
                    yield Residual(name, window, mean, covariance, bool(in_domain))

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


class WindowRows(Sequence[PushWindow]):
    """Windows packed into some 400 bytes each, so that those of a day fit into memory; indexing creates them again."""

    def __init__(self) -> None:
        self._rows: list[_Row] = []
        self._names: dict[tuple[str, ...], tuple[str, ...]] = {}  # of the covariates: one object for equal ones

    def append(self, window: PushWindow) -> None:
        """Append a window."""
        w, names = window, tuple(window.covariates)
        numbers = [w.velocity, w.contact, w.angle, w.duration, w.push_heading]
        numbers += [*w.displacement, *w.slider_start, *w.slider_end, *w.covariates.values()]
        known = self._names.setdefault(names, names)
        self._rows.append((w.push_id, w.index, w.start, w.end, known, array("d", numbers).tobytes()))

    def take(self, numbers: Iterable[int]) -> WindowRows:
        """Some of the windows, in the order of the numbers."""
        chosen = WindowRows()
        chosen._rows = [self._rows[number] for number in numbers]
        return chosen

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, number: int) -> PushWindow: ...
    @overload
    def __getitem__(self, number: slice) -> WindowRows: ...
    def __getitem__(self, number: int | slice) -> PushWindow | WindowRows:
        if isinstance(number, slice):
            return self.take(range(*number.indices(len(self))))
        push_id, index, start, end, names, packed = self._rows[number]
        numbers = array("d", packed)
        velocity, contact, angle, duration, heading = numbers[:5]
        poses = np.array(numbers[5:14]).reshape(3, 3)
        covariates = dict(zip(names, numbers[14:], strict=True))
        push = (velocity, contact, angle, duration)
        return PushWindow(push_id, index, start, end, *push, poses[0], poses[1], poses[2], heading, covariates)


class _Answers:
    """Of one model to each window, by number; refused: the reasons for windows that it was refused."""

    def __init__(self) -> None:
        self._values = array("d")
        self.refused: dict[int, str] = {}

    def expect(self) -> None:
        """Make room for the answer to a further window."""
        self._values.extend(_NO_ANSWER)

    def put(self, number: int, prediction: Prediction) -> None:
        """Take a prediction (n = 1)."""
        numbers = [*prediction.mean[0].tolist(), *prediction.covariance[0].ravel().tolist()]
        self._values[number * WIDTH : (number + 1) * WIDTH] = array("d", [*numbers, float(prediction.in_domain[0])])

    def settled(self, number: int) -> bool:
        """Whether a window is predicted or refused."""
        return number in self.refused or not isnan(self._values[number * WIDTH])

    def predicted(self) -> list[int]:
        """The numbers of the windows with a prediction."""
        return [number for number, first in enumerate(self._values[::WIDTH]) if not isnan(first)]

    def of(self, numbers: Iterable[int]) -> tuple[IntArray, Array, Array, BoolArray]:
        """Numbers (n,), means (n, 3), covariances (n, 3, 3), whether in the domain (n,) of the predicted ones."""
        known = np.array([number for number in numbers if not isnan(self._values[number * WIDTH])], np.int64)
        rows = [self._values[number * WIDTH : (number + 1) * WIDTH] for number in known.tolist()]
        values = np.array(rows).reshape(-1, WIDTH)
        return known, values[:, :3], values[:, 3:12].reshape(-1, 3, 3), values[:, 12] > 0.0


def _file_name(name: str) -> str:
    """A model's name as part of a file name: a server may give its models any name."""
    return re.sub(r"[^\w.-]", "_", name)


class RunningScore:
    """Running sums over the windows of one model.

    training_mean (3,): the reference of the NMSE. tails: of the model's predictive distribution.
    """

    def __init__(self, training_mean: Array, tails: Tails | None = None) -> None:
        self.windows = 0
        self._training_mean = training_mean
        self._half_widths = [half_widths(tails, level) for level in COVERAGE_LEVELS]
        self._pushes: set[str] = set()
        self._error, self._spread, self._nlpd = np.zeros(3), np.zeros(3), np.zeros(3)
        self._covered = np.zeros((len(COVERAGE_LEVELS), 3))

    @property
    def pushes(self) -> int:
        """The number of pushes that the windows belong to."""
        return len(self._pushes)

    def add(self, push_id: str, mean: Array, covariance: Array, observed: Array) -> None:
        """Add a window: predicted mean (3,) and covariance (3, 3), observed outcome (3,)."""
        predicted, variance, outcome = mean[None], np.diagonal(covariance)[None], observed[None]
        self.windows += 1
        self._pushes.add(push_id)
        self._error += (observed - mean) ** 2
        self._spread += (observed - self._training_mean) ** 2
        self._nlpd += gaussian_nlpd(predicted, variance, outcome)[0]
        self._covered += [coverage(predicted, variance, outcome, half) for half in self._half_widths]

    def values(self) -> dict[str, int | float | None]:
        """The totals of `metrics_json` and the coverage of each output, by name; None where undefined."""
        found: dict[str, int | float | None] = {"windows": self.windows, "pushes": self.pushes}
        known = self.windows > 0 and bool(np.all(self._spread > 0.0))
        found["nmse"] = float(np.sum(self._error / self._spread)) if known else None
        found["nlpd"] = float(np.sum(self._nlpd) / self.windows) if self.windows else None
        for level, covered in zip(COVERAGE_LEVELS, self._covered, strict=True):
            shares = (float(c) / self.windows if self.windows else None for c in covered)
            found |= {f"coverage {level} {name}": share for name, share in zip(OUTPUTS, shares, strict=True)}
        return found


def write_report(
    pipe: object,
    models: list[PushModel],
    windows: WindowRows,
    comparisons: list[Comparison],
    folder: Path,
    alarm: Mapping[str, object] | None,
) -> None:
    """Write FOLDER/report.html; a Child runs this. alarm: of the main model, as in validation.json."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that unfinished files are removed
    try:
        report_windows(models, windows, comparisons, folder, "online validation", alarm=alarm)
    except (PushPredictorError, OSError) as error:
        sys.exit(f"report: {' '.join(str(error).split())}")


def write_window_log(
    path: Path,
    windows: Sequence[PushWindow],
    comparison: Comparison,
    refused: Sequence[Refusal] = (),
    unanswered: int = 0,
) -> None:
    """Write {"model", "windows", "refused", "unanswered"}; an older file is replaced when the new one is complete.

    windows: one for each row of the comparison. refused: further windows. unanswered: how many more there were.
    Raises OSError that names the path.
    """
    write_whole(path, (line.encode() for line in _lines(windows, comparison, refused, unanswered)))


def _lines(
    windows: Sequence[PushWindow], comparison: Comparison, refused: Sequence[Refusal], unanswered: int
) -> Iterator[str]:
    """The text entry by entry: as one string a day's windows would take a gigabyte."""
    yield f'{{"model": {json.dumps(comparison.model)}, "windows": ['
    for k, entry in enumerate(window_log(windows, comparison)):
        yield ("," if k else "") + "\n" + json.dumps(entry, allow_nan=False)
    rest = json.dumps([asdict(refusal) for refusal in refused])
    yield f'],\n"refused": {rest}, "unanswered": {unanswered}}}\n'


def window_log(windows: Sequence[PushWindow], comparison: Comparison) -> Iterator[dict[str, object]]:
    """One entry for each window, in the fields and units of PushResidual; stamps in ns."""
    z = standardised(comparison.mean, comparison.covariance, comparison.observed)
    for k, window in enumerate(windows):
        yield {
            "push_id": window.push_id,
            "window": window.index,
            "start": window.start,
            "end": window.end,
            "velocity": window.velocity,
            "contact": window.contact,
            "angle": window.angle,
            "duration": window.duration,
            "predicted": comparison.mean[k].tolist(),
            "covariance": comparison.covariance[k].ravel().tolist(),
            "observed": comparison.observed[k].tolist(),
            "standardised": z[k].tolist(),
        }
