# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The process of one trace: it reads the recorded pushes, runs the trace and writes the results into a work folder.

It reports to the node through a pipe. When the node has died, it ends and deletes the work folder.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.errors import PushPredictorError, RecordingError
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.rig import HOW_TO_GIVE

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from push_predictor.residuals.outcome import Trace

REPORT, VERDICT, EXTENDED = "trace.html", "trace.json", "extended.pushmodel"
RESULTS = (EXTENDED, REPORT, VERDICT)
COPIES = "evidence"
NOT_TRACED = ("residuals",)  # a validator's bag of push_residual contains no sensor streams


@dataclass(frozen=True)
class TraceTask:
    """The pushes to trace, the model file, covariates (empty: all), the level alpha and the work folder."""

    evidence: tuple[Path, ...]
    model: Path
    covariates: tuple[str, ...]
    alpha: float
    folder: Path


@dataclass(frozen=True)
class Stage:
    """The present stage of a trace and the completed share of the work, 0 to 1."""

    name: str
    share: float


@dataclass(frozen=True)
class Traced:
    """The verdict as JSON and in words. needs: covariates of the extended model, None if there is no such model."""

    verdict: str
    message: str
    needs: tuple[str, ...] | None


def run_trace(connection: Connection, task: TraceTask) -> None:
    """Send Stage messages, then Traced; a Child runs this. Raises PushPredictorError or OSError."""
    try:
        connection.send(_traced(connection, task))
    except (BrokenPipeError, ConnectionResetError):
        shutil.rmtree(task.folder, ignore_errors=True)  # the node has died and cannot do it


def evidence_in(folder: Path) -> tuple[Path, ...]:
    """A file that was given, or the data in a folder that can be traced; empty if there is none or no such folder.

    A validator's table comes first, then the folder itself as a recording, then all push tables and recordings in it.
    """
    from push_predictor.online.run_files import TABLE
    from push_predictor.recordings.table_file import ENDINGS

    if (folder / TABLE).is_file():
        return (folder / TABLE,)
    if folder.is_file() or _is_bag(folder):
        return (folder,)
    inside = sorted(folder.iterdir()) if folder.is_dir() else []
    return tuple(path for path in inside if path.name.endswith((*ENDINGS, ".mcap")) or _is_bag(path))


def _is_bag(path: Path) -> bool:
    from push_predictor.recordings.bag.metadata import METADATA_FILE

    return (path / METADATA_FILE).is_file() and path.name not in NOT_TRACED


def for_client(text: str, task: TraceTask) -> str:
    """A message on one line, with the paths and the advice that the action's client knows."""
    text = text.replace(str(task.folder / COPIES), str(task.evidence[0].parent))
    text = text.replace(str(task.folder), str(task.folder.parent))  # where the results would have been moved
    text = text.replace(HOW_TO_GIVE, "write it there")  # an action has no command-line options
    return " ".join(text.split())


def _traced(connection: Connection, task: TraceTask) -> Traced:
    # Imported here: the node that starts this process does not need these modules.
    from push_predictor.models.store.model_file import save_model
    from push_predictor.recordings.checks.check import DataChecks
    from push_predictor.residuals.outcome import trace_json
    from push_predictor.residuals.reporting.sentences import answer, rivals, worth
    from push_predictor.residuals.trace import trace_data

    def watch(stage: str, share: float) -> None:
        connection.send(Stage(stage, 0.9 * share))

    paths, warnings = [_settled(path, task.folder) for path in task.evidence], list[str]()
    checks, names = DataChecks(False, warnings.append), task.covariates or None
    trace = trace_data(paths, task.model, alpha=task.alpha, covariates=names, watch=watch, checks=checks)
    watch("report", 1.0)
    text = json.dumps(trace_json(trace), indent=2, allow_nan=False)
    write_whole(task.folder / VERDICT, f"{text}\n".encode())
    if trace.extended is not None:
        save_model(trace.extended, task.folder / EXTENDED)
    sentences = [*answer(trace), rivals(trace), worth(trace), *_report(task.folder / REPORT, trace)]
    sentences += [f"Warning: {for_client(text, task)}" for text in warnings]
    return Traced(text, " ".join(filter(None, sentences)), None if trace.extended is None else trace.extended.needs)


def _report(path: Path, trace: Trace) -> Sequence[str]:
    """Write the page; where figures cannot be drawn, return the reason."""
    from push_predictor.residuals.reporting.page import write_trace_report

    try:
        write_trace_report(path, trace)
    except PushPredictorError as error:
        return [f"No report: {error}."]
    return []


def _settled(path: Path, folder: Path) -> Path:
    """A copy of a table that a validator may be appending to, without an incomplete last line; else the path itself."""
    from push_predictor.online.run_files import TABLE
    from push_predictor.recordings.table_file import rig_path

    if path.name != TABLE:
        return path
    copy = folder / COPIES / TABLE
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    write_whole(copy, data[: data.rfind(b"\n") + 1])
    if rig_path(path).exists():
        shutil.copyfile(rig_path(path), rig_path(copy))
    return copy
