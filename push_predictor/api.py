# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The Python interface: from recordings to a model, a prediction, a validation, a trace, the next push.

Paths are str or Path. `from push_predictor import ...` gives these functions; `push_predictor.__init__` lists them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import RequestError
from push_predictor.evaluation.metrics_text import metrics_lines
from push_predictor.evaluation.offline import validate_recording, window_options
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MeanChoice
from push_predictor.planning import choose
from push_predictor.planning.goal import Goal
from push_predictor.planning.model_repertoire import model_repertoire
from push_predictor.planning.repertoire import Repertoire
from push_predictor.recordings.load import different_supports, load_data, load_rig_for
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig, load_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import empty_table
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows import finder
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
from push_predictor.watch import Watch

if TYPE_CHECKING:
    from push_predictor.residuals.outcome import Trace

AnyPath = str | os.PathLike[str]


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
) -> PushModel:
    """Train a model on recordings or push tables; a prior model needs none, but then a rig.

    kind: vhgp, gp, analytical or prior. rig: a Rig or a rig file, needed only where the data name none. name: of the
    model in the services; the first file's stem unless given. n_train: that many windows at random by the seed; by
    default all up to 1000, beyond that 1000 spread evenly over the pushes. fit: choose and estimate the parameters of
    an analytical model. mean: of a vhgp or gp: mechanics fitted first, about which the residual is learnt; zero; or
    auto, which takes the one that predicts held-out training pushes better. watch: called with each stage
    and the share of the work done; by default stages are printed to stderr. topics: of the recordings.
    Raises PushPredictorError (RecordingError, TableError, RigError, TrainingError) that names the file or field.
    """
    watch = watch or _print_stage
    paths = [] if kind == "prior" and not data else _paths(data)
    watch("read the data", 0.0)
    known = _rig(rig) or load_rig_for(paths)
    supports = different_supports(paths) if (fit or kind == "prior") and rig is None else {}
    table = load_data(paths, known, numbered=bool(supports), topics=topics) if paths else empty_table()
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
    model: PushModel, recording: AnyPath, *, rig: Rig | AnyPath | None = None, topics: Topics = Topics()
) -> Validation:
    """Predict every window of a recording that the model was not trained on, and score the predictions.

    Raises RecordingError or RigError that names the file.
    """
    return Validation(*validate_recording(model, Path(recording), _rig(rig), None, topics))


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
    experiment: AnyPath | Sequence[AnyPath] = (),
    topics: Topics = Topics(),
) -> Trace:
    """Find out why a model no longer fits new recordings: the effect it lacks, its size, and the extended model.

    alpha: probability of reporting any effect where there is none. covariates: those to try; all unless given.
    experiment: recordings of the pushes that an earlier trace proposed; they are analysed and never held out.
    topics: of the recordings. Raises RequestError, RecordingError, TableError or RigError.
    """
    from push_predictor.residuals.evidence.loading import load_evidence
    from push_predictor.residuals.trace import trace as trace_loaded

    designed = _paths(experiment) if experiment else []
    loaded = load_evidence(_paths(data), _rig(rig), window_options(model), experiment=designed, topics=topics)
    watch = watch or _print_stage
    return trace_loaded(model, loaded, alpha=alpha, covariates=covariates, seed=seed, watch=watch)


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
