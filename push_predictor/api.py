# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The Python interface: from recordings to a model, a prediction, a validation, a trace, the next push.

Paths are str or Path. `from push_predictor import ...` gives these functions; `push_predictor.__init__` lists them.
"""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import DataWarning, RequestError
from push_predictor.evaluation.metrics import metrics_lines
from push_predictor.evaluation.offline import remarks, validate_recording
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.models.push_model import LEARNT, PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MeanChoice
from push_predictor.planning import choose
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import model_repertoire
from push_predictor.planning.repertoire import Repertoire
from push_predictor.recordings.checks.check import DataChecks
from push_predictor.recordings.load import different_supports, load_data, load_rig_for, required_rig
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig, load_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import empty_table
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows import finder
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions, windows_to_table
from push_predictor.watch import Watch

if TYPE_CHECKING:
    from push_predictor.residuals.outcome import Trace

AnyPath = str | os.PathLike[str]
_OWN_FILES = (f"{Path(__file__).parent}{os.sep}", contextlib.__file__)  # contextlib: of the decorators below


def train(
    data: AnyPath | Sequence[AnyPath] = (),
    *,
    kind: str = "vhgp",
    rig: Rig | AnyPath | None = None,
    name: str | None = None,
    n_train: int | None = None,
    seed: int = 0,
    fit: bool = False,
    mean: MeanChoice = "auto",
    topics: Topics = Topics(),
    watch: Watch | None = None,
    strict: bool = False,
) -> PushModel:
    """Train a model on recordings or push tables; a prior model needs none, but then a rig.

    kind: vhgp, gp, analytical or prior. rig: a Rig or a rig file, needed only where the data name none. name: of the
    model in the services; the first file's stem unless given. n_train: that many windows at random by the seed; by
    default all up to 1000, beyond that 1000 spread evenly over the pushes. fit: choose and estimate the parameters of
    an analytical model. mean: of a vhgp or gp: mechanics fitted first, about which the residual is learnt; zero; or
    auto, which takes mechanics unless zero predicts held-out pushes clearly better. watch: called with each stage
    and the share of the work done; by default stages are printed to stderr. topics: of the recordings.

    The data are checked as by `push_predictor check`. A DataWarning names a probable mistake, or too few pushes for a
    learnt model; strict: raise RecordingError instead.
    Raises PushPredictorError (RecordingError, TableError, RigError, TrainingError) that names the file or field.
    """
    watch = watch or _print_stage
    paths = [] if kind == "prior" and not data else _paths(data)
    watch("read the data", 0.0)
    known = _rig(rig) or load_rig_for(paths)
    supports = different_supports(paths) if (fit or kind == "prior") and rig is None else {}
    checks = DataChecks(strict, _warn)
    table = empty_table()
    if paths:
        table = load_data(paths, known, numbered=bool(supports), topics=topics, inspect=checks)
        if kind in LEARNT:
            checks.learnt_from(paths, table, known)
    return train_model(
        table,
        known,
        kind,
        name=name or (paths[0].name.split(".")[0] if paths else kind),
        sources=[path.name for path in paths],
        options=TrainingOptions(n_train=n_train, seed=seed, fit=fit, supports=supports, mean=mean),
        watch=watch,
    )


def find_windows(
    recording: Recording, rig: Rig | AnyPath | None = None, *, duration: float = 0.2, stride: float | None = None
) -> list[PushWindow]:
    """Find all windows of a recording, in order of time.

    duration: of a window, s. stride: time between window starts, s; end to end unless given. rig: in place of the
    recorded one. Raises RigError if there is none, RequestError for a duration or stride that is not above 0.
    """
    for field, value in (("duration", duration), ("stride", duration if stride is None else stride)):
        if not 0.0 < value < float("inf"):
            raise RequestError(field, value, "a finite number above 0, in s")
    known = _rig(rig) or require_rig(recording)
    return finder.find_windows(recording, known, WindowOptions(duration=duration, stride=stride))


@dataclass(frozen=True, eq=False, repr=False)
class Validation:
    """A model compared with a recording: the windows, the predictions for them, and the metrics."""

    windows: list[PushWindow]
    comparison: Comparison

    @cached_property
    def metrics(self) -> dict[str, Any]:
        """Metrics as `push_predictor validate --json` writes them (docs/reference/json.md)."""
        return metrics_json(self.comparison)

    def __repr__(self) -> str:
        return "\n".join(metrics_lines(self.metrics))


@one_blas_thread()
def validate(
    model: PushModel,
    recording: AnyPath,
    *,
    rig: Rig | AnyPath | None = None,
    topics: Topics = Topics(),
    strict: bool = False,
) -> Validation:
    """Predict every window of a recording that the model was not trained on, and score the predictions.

    The recording is checked as by `push_predictor check`. A DataWarning names a probable mistake, faults of the
    streams, another slider than the model's, training pushes, or a domain of which little was pushed. strict: raise
    RecordingError for a mistake, and where little was pushed.
    Raises RecordingError or RigError that names the file.
    """
    path, given = Path(recording), _rig(rig)
    windows, comparison = validate_recording(model, path, given, _warn, topics, DataChecks(strict, _warn))
    for text in remarks(model, given or required_rig(path), windows_to_table(windows)):
        _warn(text)
    return Validation(windows, comparison)


@one_blas_thread()
def trace(
    model: PushModel,
    data: AnyPath | Sequence[AnyPath],
    *,
    alpha: float = 0.01,
    covariates: Sequence[str] | None = None,
    rig: Rig | AnyPath | None = None,
    seed: int = 0,
    watch: Watch | None = None,
    topics: Topics = Topics(),
    strict: bool = False,
) -> Trace:
    """Find out why a model no longer fits new recordings: the effect it lacks, its size, and the extended model.

    alpha: probability of reporting any effect where there is none. covariates: those to try; all unless given.
    topics: of the recordings.

    The data are checked as by `push_predictor check`. A DataWarning names a probable mistake, or a domain of which
    little was pushed; strict: raise RecordingError instead.
    Raises RequestError, RecordingError, TableError or RigError.
    """
    from push_predictor.residuals.trace import trace_data

    return trace_data(
        _paths(data),
        model,
        alpha=alpha,
        covariates=covariates,
        rig=_rig(rig),
        seed=seed,
        watch=watch or _print_stage,
        topics=topics,
        checks=DataChecks(strict, _warn),
    )


@one_blas_thread()
def choose_push(
    model: PushModel | Repertoire, slider: Sequence[float], goal: Goal, *, probability: float = 0.9
) -> choose.Choice | None:
    """Choose the next push that brings the slider to a goal with few pushes; None if it is there.

    model: pushes all around the slider, at the speed of its training pushes, are worked out once and kept; give a
    Repertoire to choose among others. slider: pose x, y (m) and heading (rad) in the world. probability: at which one
    push shall reach the goal. Raises RequestError.
    """
    pushes = model if isinstance(model, Repertoire) else _kept_repertoire(model)
    return choose.choose_push(pushes, np.asarray(slider, dtype=np.float64), goal, probability)


@lru_cache(maxsize=4)
def _kept_repertoire(model: PushModel) -> Repertoire:
    return model_repertoire(model)


def _paths(data: AnyPath | Sequence[AnyPath]) -> list[Path]:
    paths = [Path(data)] if isinstance(data, str | os.PathLike) else [Path(path) for path in data]
    if not paths:
        raise RequestError("data", [], "at least one recording or push table")
    return paths


def _rig(rig: Rig | AnyPath | None) -> Rig | None:
    return rig if rig is None or isinstance(rig, Rig) else load_rig(Path(rig))


def _print_stage(stage: str, done: float) -> None:
    print(f"{100 * done:3.0f} %  {stage}", file=sys.stderr, flush=True)


def _warn(text: str) -> None:
    """Issue a DataWarning at the line that called this package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_OWN_FILES):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, DataWarning, stacklevel=level)
