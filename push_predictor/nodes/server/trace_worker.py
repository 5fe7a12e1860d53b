"""The process of a trace: reads what was recorded, traces, and lays the results down where the node takes them from.

It knows no ROS. What it tells comes through a pipe; when the node is gone it ends and leaves nothing.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import signal
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from push_predictor.errors import PushPredictorError, RecordingError
from push_predictor.online.window_table import TABLE
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.bag.metadata import METADATA_FILE
from push_predictor.recordings.rig import HOW_TO_GIVE
from push_predictor.recordings.table_file import ENDINGS, rig_path

REPORT, VERDICT, EXTENDED = "trace.html", "trace.json", "extended.pushmodel"
WRITTEN = (EXTENDED, REPORT, VERDICT)
COPIES = "evidence"
NICENESS = 5  # a push that is asked for must not wait for the trace
NOT_TRACED = ("residuals",)  # a validator's bag of push_residual holds no streams


@dataclass(frozen=True)
class TraceTask:
    """What is to be traced, and the folder where the model file lies and the results are laid down."""

    evidence: tuple[Path, ...]
    model: Path
    covariates: tuple[str, ...]
    alpha: float
    place: Path


@dataclass(frozen=True)
class Stage:
    """What is being done, and which share of the work is behind."""

    name: str
    share: float


@dataclass(frozen=True)
class Traced:
    """The verdict as JSON, and in words; needs: what the extended model asks of a request, None if there is no such."""

    verdict: str
    message: str
    needs: tuple[str, ...] | None


@dataclass(frozen=True)
class Failed:
    """Why there is no verdict."""

    reason: str


def start_trace(task: TraceTask) -> tuple[BaseProcess, Connection]:
    """The running process, and the pipe that tells Stage after Stage, then Traced or Failed."""
    # spawned: a fork would inherit the threads' locks of the middleware
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_serve, args=(theirs, task), daemon=True, name="trace")
    process.start()
    theirs.close()
    return process, ours


def evidence_in(folder: Path) -> tuple[Path, ...]:
    """What can be traced in a folder: the table of a validator, else the folder as a recording, else every push table
    and recording in it; none if it holds none or is not there.
    """
    if (folder / TABLE).is_file():
        return (folder / TABLE,)
    if _is_bag(folder):
        return (folder,)
    inside = sorted(folder.iterdir()) if folder.is_dir() else []
    return tuple(path for path in inside if path.name.endswith((*ENDINGS, ".mcap")) or _is_bag(path))


def _is_bag(path: Path) -> bool:
    return (path / METADATA_FILE).is_file() and path.name not in NOT_TRACED


def _serve(connection: Connection, task: TraceTask) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the node ends this process
    os.nice(NICENESS)
    try:
        connection.send(_traced(connection, task))
    except (BrokenPipeError, ConnectionResetError):
        shutil.rmtree(task.place, ignore_errors=True)  # the node is gone and cannot do it
    except (PushPredictorError, OSError) as error:
        told = str(error).replace(str(task.place / COPIES), str(task.evidence[0].parent))
        told = told.replace(str(task.place), str(task.place.parent))  # where the results would have gone
        told = told.replace(HOW_TO_GIVE, "write it there")  # there is no option of that name here
        connection.send(Failed(" ".join(told.split())))


def _traced(connection: Connection, task: TraceTask) -> Traced:
    # Imported here: the node that starts this process has no need of the search.
    from push_predictor.models.store.model_file import save_model
    from push_predictor.residuals.reporting.trace_json import trace_json
    from push_predictor.residuals.reporting.wording import verdict_sentence, worth_sentence
    from push_predictor.residuals.trace import trace_data

    def watch(stage: str, share: float) -> None:
        connection.send(Stage(stage, 0.9 * share))

    paths = [_settled(path, task.place) for path in task.evidence]
    found = trace_data(paths, task.model, alpha=task.alpha, covariates=task.covariates or None, watch=watch)
    watch("report", 1.0)
    text = json.dumps(trace_json(found), indent=2, allow_nan=False)
    write_whole(task.place / VERDICT, f"{text}\n".encode())
    if found.extended is not None:
        save_model(found.extended, task.place / EXTENDED)
    sentences = [verdict_sentence(found), worth_sentence(found), *_report(task.place / REPORT, found)]
    return Traced(text, " ".join(sentences), None if found.extended is None else found.extended.needs)


def _report(path: Path, found: object) -> Sequence[str]:
    """Write the page; why there is none, where pictures cannot be made."""
    from push_predictor.residuals.outcome import Trace
    from push_predictor.residuals.reporting.page import write_trace_report

    assert isinstance(found, Trace)
    try:
        write_trace_report(path, found)
    except PushPredictorError as error:
        return [f"No report: {error}."]
    return []


def _settled(path: Path, place: Path) -> Path:
    """A table that a validator may be appending to, as it is now, less a last line that is not whole."""
    if path.name != TABLE:
        return path
    copy = place / COPIES / TABLE
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    write_whole(copy, data[: data.rfind(b"\n") + 1])
    if rig_path(path).exists():
        shutil.copyfile(rig_path(path), rig_path(copy))
    return copy
