"""Validating models on a recording read from disk: the offline counterpart of push_validator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from push_predictor.errors import RecordingError
from push_predictor.evaluation.validation import Comparison, compare, metrics_json, trained_on
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import check_table
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.window_finder import find_windows
from push_predictor.recordings.windows import PushWindow, WindowOptions, windows_to_table


def recorded_windows(model: PushModel, path: Path, rig: Rig | None = None) -> tuple[list[PushWindow], PushTable]:
    """The windows of a recording, as long as the model's training windows. Raises RecordingError if there is none."""
    recording = read_recording(path, rig=rig)
    windows = find_windows(recording, require_rig(recording), window_options(model))
    if not windows:
        raise RecordingError(f"{path}: no push was found in {len(recording.slider)} slider poses")
    return windows, windows_to_table(windows)


def window_options(model: PushModel) -> WindowOptions:
    """Windows of the length that a learnt model was trained on; 0.2 s for the analytical one."""
    if model.kind == "analytical":
        return WindowOptions()
    return WindowOptions(duration=float(model.training.duration[0]))


def validate_recording(model: PushModel, path: Path, rig: Rig | None = None) -> tuple[list[PushWindow], Comparison]:
    """Predict every window of a recording."""
    windows, table = recorded_windows(model, path, rig)
    check_table(model, table)
    return windows, compare(model, table)


def report_recording(models: Sequence[PushModel], path: Path, out: Path) -> tuple[Path, list[dict[str, object]]]:
    """Write the HTML report of several models, the first the main one, on one recording; returns page and metrics."""
    windows, table = recorded_windows(models[0], path)
    comparisons = [compare(model, table) for model in models]
    page = report_windows(models, windows, comparisons, out, path.name)
    return page, [metrics_json(comparison) for comparison in comparisons]


def report_windows(
    models: Sequence[PushModel],
    windows: Sequence[PushWindow],
    comparisons: Sequence[Comparison],
    out: Path,
    name: str,
    more: Mapping[str, str] | None = None,
) -> Path:
    """The same for windows that were predicted already, by a server for instance; more: further facts for the page."""
    from push_predictor.evaluation.report import write_validation_report  # matplotlib: only where pictures are made

    table = windows_to_table(windows)
    seen = trained_on(models[0], table)
    split = f"{len(seen)} of the pushes were trained on" if seen else "pushes that were not trained on, kept whole"
    facts = {"recording": name, "split": split, **(more or {})}
    return write_validation_report(out, f"Validation on {name}", table, windows, models, comparisons, facts, ())
