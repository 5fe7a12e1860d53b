"""Validation while windows arrive: which were predicted by whom, and what that says so far. No ROS in here."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.evaluation.validation import Comparison, comparison_of, metrics_json
from push_predictor.evaluation.window_log import write_window_log
from push_predictor.models.push_model import Prediction, PushModel
from push_predictor.recordings.windows import PushWindow, windows_to_table

MAIN_RESULT = "validation.json"


class LiveValidation:
    """Windows in the order they were found, and the predictions of each model as they come in.

    models: the first is the main one.
    """

    def __init__(self, models: Sequence[PushModel]) -> None:
        self.models = tuple(models)
        self.windows: list[PushWindow] = []
        self._predictions: list[dict[int, Prediction]] = [{} for _ in models]

    def add(self, window: PushWindow) -> int:
        """Take a window; returns its number."""
        self.windows.append(window)
        return len(self.windows) - 1

    def record(self, model: int, window: int, prediction: Prediction) -> None:
        """Take what a model predicted for a window (n = 1)."""
        self._predictions[model][window] = prediction

    def predicted(self, model: int = 0) -> list[PushWindow]:
        """The windows that a model has answered, in order."""
        return [self.windows[k] for k in sorted(self._predictions[model])]

    def comparison(self, model: int = 0) -> Comparison:
        """What a model predicted beside what was observed, for the windows it has answered."""
        answers = [self._predictions[model][k] for k in sorted(self._predictions[model])]
        table = windows_to_table(self.predicted(model))
        return comparison_of(self.models[model], table, _stacked(answers))

    def write(self, folder: Path) -> list[Path]:
        """Write validation.json of the main model, validation_NAME.json of the others, and their windows one by one."""
        folder.mkdir(parents=True, exist_ok=True)
        written = []
        for k, model in enumerate(self.models):
            comparison, suffix = self.comparison(k), "" if k == 0 else f"_{model.name}"
            path = folder / MAIN_RESULT.replace(".json", f"{suffix}.json")
            temporary = path.with_name(f".{path.name}.part")
            temporary.write_text(json.dumps(metrics_json(comparison), indent=2, allow_nan=False) + "\n")
            temporary.replace(path)
            write_window_log(folder / f"windows{suffix}.json", self.predicted(k), comparison)
            written.append(path)
        return written


def _stacked(answers: Sequence[Prediction]) -> Prediction:
    return Prediction(
        np.array([answer.mean[0] for answer in answers]).reshape(-1, 3),
        np.array([answer.covariance[0] for answer in answers]).reshape(-1, 3, 3),
        np.array([answer.process_covariance[0] for answer in answers]).reshape(-1, 3, 3),
        np.array([answer.in_domain[0] for answer in answers], dtype=np.bool_),
    )
