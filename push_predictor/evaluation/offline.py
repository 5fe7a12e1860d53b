# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Validate models on a recording from disk, as push_validator does online."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.evaluation.alarm.scores import recording_alarm
from push_predictor.evaluation.validation import Comparison, compare, comparison_of, metrics_json, trained_on
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import check_pushes
from push_predictor.models.store.table_cache import as_served
from push_predictor.models.train_mechanics import on_supports
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions, windows_to_table
from push_predictor.recordings.windows.stream_faults import describe_recording_faults
from push_predictor.watch import Watch, no_watch, part_of, watched

if TYPE_CHECKING:
    from push_predictor.recordings.checks.check import DataChecks


def recorded_windows(
    model: PushModel,
    path: Path,
    rig: Rig | None = None,
    report: Callable[[str], None] | None = None,
    topics: Topics = Topics(),
    checks: DataChecks | None = None,
) -> tuple[list[PushWindow], PushTable, Rig]:
    """The windows of a recording, with the model's duration, and its rig. Raises RecordingError without a window.

    report receives a sentence for each fault of the streams. checks: of the recording and of what its windows cover.
    """
    recording = read_recording(path, rig=rig, topics=topics)
    rig = require_rig(recording)
    if checks is not None:
        checks(path, recording, rig)
    finder = WindowFinder(rig, window_options(model))
    windows = finder.find(recording)
    if report is not None:
        for fault in describe_recording_faults(recording, finder.counts):
            report(fault)
    if not windows:
        raise RecordingError(f"{path}: no push was found in {len(recording.slider)} slider poses")
    table = windows_to_table(windows)
    if checks is not None:
        checks.judged_by([path], table, rig)
    return windows, table, rig


def window_options(model: PushModel) -> WindowOptions:
    """Windows with the training duration of a learnt model; 0.2 s for the analytical model."""
    if not model.predictor.learnt:
        return WindowOptions()
    return WindowOptions(duration=float(model.training.duration[0]))


def rig_difference(model: PushModel, rig: Rig) -> str:
    """A sentence on how a rig differs from that of the model's training, empty if it does not."""
    trained = model.rig
    if not _same(trained.outline.vertices, rig.outline.vertices) or trained.outline.semi_axes != rig.outline.semi_axes:
        if trained.shape == rig.shape:
            return f"model {model.name!r} was trained with another outline of {rig.shape!r} (pose or size)"
        return f"model {model.name!r} was trained with the outline of {trained.shape!r}, the rig is {rig.shape!r}"
    if not _same(trained.pusher_radius, rig.pusher_radius):
        radii = f"{trained.pusher_radius:g} m, the rig's is {rig.pusher_radius:g} m"
        return f"model {model.name!r} was trained with a pusher radius of {radii}"
    return ""


def remarks(model: PushModel, rig: Rig, table: PushTable) -> list[str]:
    """Why the scores of a model on the windows of a rig may mislead: another slider, or training pushes."""
    return [text for text in (rig_difference(model, rig), training_overlap(model, table)) if text]


def training_overlap(model: PushModel, table: PushTable) -> str:
    """A warning that names how many pushes of a table were used for training, empty if none."""
    used, pushes = len(trained_on(model, table)), len(table.pushes)
    return f"{used} of these {pushes} pushes were used for training: the scores are optimistic." if used else ""


def validate_recording(
    model: PushModel,
    path: Path,
    rig: Rig | None = None,
    report: Callable[[str], None] | None = None,
    topics: Topics = Topics(),
    checks: DataChecks | None = None,
) -> tuple[list[PushWindow], Comparison]:
    """Predict every window of a recording, as predict_server does; report and checks as for `recorded_windows`."""
    windows, table, rig = recorded_windows(model, path, rig, report, topics, checks)
    model = on_supports(model, rig, {})
    table = model.continued(table)
    check_pushes(model, table)
    prediction = as_served(model).predict_rows(table.inputs, table.duration, table.covariates)
    return windows, comparison_of(model, table, prediction.mean, prediction.covariance)


def report_recording(
    models: Sequence[PushModel],
    path: Path,
    out: Path,
    rig: Rig | None = None,
    topics: Topics = Topics(),
    watch: Watch = no_watch,
    report: Callable[[str], None] | None = None,
    checks: DataChecks | None = None,
) -> tuple[Path, list[dict[str, object]]]:
    """Write the HTML report of models on a recording, the main model first; return page and metrics.

    watch: called with the share of the work done. report and checks as for `recorded_windows`.
    """
    watch("windows", 0.0)
    windows, table, rig = recorded_windows(models[0], path, rig, report, topics, checks)
    models = [on_supports(model, rig, {}) for model in models]
    tables = [model.continued(table) for model in models]
    for model, own in zip(models, tables, strict=True):
        check_pushes(model, own)
    each = watched(list(zip(models, tables, strict=True)), part_of(watch, 0.1, 0.5), "model")
    comparisons = [compare(model, own) for model, own in each]
    alarm = recording_alarm(models[0], table, comparisons[0])
    watch("figures", 0.5)
    page = report_windows(models, windows, comparisons, out, path.name, alarm=alarm)
    return page, [metrics_json(comparison) for comparison in comparisons]


def _same(first: object, second: object) -> bool:
    """Whether values agree to a micrometre."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=1e-6))


def report_windows(
    models: Sequence[PushModel],
    windows: Sequence[PushWindow],
    comparisons: Sequence[Comparison],
    out: Path,
    name: str,
    more: Mapping[str, str] | None = None,
    alarm: Mapping[str, object] | None = None,
) -> Path:
    """Write the report for windows with given predictions; more: further facts for the page; alarm: of the first."""
    from push_predictor.evaluation.report.page import (
        write_validation_report,  # imports matplotlib
    )

    table = windows_to_table(windows)
    facts = {"recording": name, **(more or {})}
    return write_validation_report(out, f"Validation on {name}", table, windows, models, comparisons, facts, (), alarm)
