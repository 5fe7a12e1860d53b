# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A disk that fills up during writing: the old file stays, no other file remains, the error names the path.

The limit on the size of a file (RLIMIT_FSIZE) makes a write fail half-way, as a full disk does.
"""

from __future__ import annotations

import json
import os
import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from made_up_traces import made_up_trace, slippery
from synthetic import noisy_pushes, square_rig

from push_predictor.cli import main
from push_predictor.commands.common import progress
from push_predictor.commands.common.output import write_text
from push_predictor.error_codes import ErrorCode, error_code
from push_predictor.errors import RecordingError
from push_predictor.evaluation.report.page import write_validation_report
from push_predictor.evaluation.validation import compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.online import trace_process
from push_predictor.recordings import atomic
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.bag.message_types import FLOAT64
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording
from push_predictor.reporting.canvas import draw
from push_predictor.residuals.reporting import page as trace_report
from push_predictor.residuals.reporting.page import write_trace_report


@contextmanager
def full_disk(most: int = 200) -> Iterator[None]:
    """Limit the size of files, in bytes. Python would keep the part of a module's bytecode that fits."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        with patch.object(sys, "dont_write_bytecode", True):
            yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def table(rows: int) -> PushTable:
    return noisy_pushes(rows)


@pytest.fixture(scope="module")
def model() -> PushModel:
    return train_model(noisy_pushes(60), square_rig(), "gp", name="m", options=TrainingOptions(mean="zero"))


def bag(path: Path, count: int, compression: str = "none") -> None:
    """More than one chunk, so that the disk is written to while messages are added."""
    with BagWriter(path, compression=compression) as writer:
        writer.add_topic("x", FLOAT64.name, FLOAT64.definition)
        for stamp in range(count):
            writer.write("x", stamp, bytes(1 << 18))


def page_without_pictures(folder: Path, model: PushModel, title: str) -> None:
    none = table(30).take(np.zeros(30, dtype=np.bool_))
    write_validation_report(folder, title, none, [], [model], [compare(model, none)], {}, [])


WRITERS: dict[str, Callable[[Path, int, PushModel, Recording], Any]] = {
    "m.pushmodel": lambda p, k, m, r: save_model(replace(m, name=f"m{k}"), p),
    "t.csv": lambda p, k, m, r: write_table(p, table(30 + k)),
    "t.csv.gz": lambda p, k, m, r: write_table(p, table(30 + k)),
    "r.json": lambda p, k, m, r: write_text(p, json.dumps(list(range(100 + k)))),
    "p.png": lambda p, k, m, r: draw(p, (1.0 + k, 1.0), lambda figure: None),
    "report": lambda p, k, m, r: page_without_pictures(p, m, f"title {k}"),
    "trace.html": lambda p, k, m, r: write_trace_report(p, made_up_trace(count=20)),
    "bag": lambda p, k, m, r: write_recording(p, replace(r, wrench=None) if k else r),
    "bag.mcap": lambda p, k, m, r: write_recording(p, replace(r, wrench=None) if k else r),
    "long": lambda p, k, m, r: bag(p, 8 + k),
    "long.mcap": lambda p, k, m, r: bag(p, 8 + k),
}


@pytest.mark.parametrize("name", WRITERS)
def test_the_old_file_stays_and_the_error_names_the_path(
    name: str, model: PushModel, recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, write = tmp_path / "out" / name, WRITERS[name]
    monkeypatch.setattr(trace_report, "_parts", lambda trace: ["<p>a page</p>" * 100])  # figures take seconds
    path.parent.mkdir()
    for turn in (0, 1):  # without an earlier file, and with one
        before = contents(tmp_path)
        with full_disk(), pytest.raises((OSError, RecordingError)) as caught:
            write(path, turn, model, recording)
        assert str(path) in str(caught.value)
        assert contents(tmp_path) == before
        assert all(not entry.name.startswith(".") for entry in tmp_path.rglob("*"))
        if not turn:
            write(path, 0, model, recording)  # the disk has room again
            assert path.exists()


@pytest.mark.parametrize("most", [0, 3000, 1 << 20, (1 << 20) + 100, (1 << 21) + 500])
def test_a_bag_is_whole_wherever_the_disk_fills_up(most: int, tmp_path: Path) -> None:
    """The limit lies in the header, in a chunk, between chunks, in the summary."""
    bag(tmp_path / "b", 8)
    before = contents(tmp_path)
    with full_disk(most), pytest.raises(RecordingError, match=f"{tmp_path}/b: cannot be written \\(File too large\\)"):
        bag(tmp_path / "b", 9)
    assert contents(tmp_path) == before


def test_an_error_reported_only_by_fsync_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As network file systems do."""
    (tmp_path / "f").write_bytes(b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(OSError, match=f"No space left on device: '{tmp_path}/f'"):
        write_whole(tmp_path / "f", b"new")
    assert contents(tmp_path) == {"f": b"old"}


def test_writing_keeps_links_and_devices_and_accepts_long_names(tmp_path: Path) -> None:
    (tmp_path / "f").write_bytes(b"old")
    (tmp_path / "link").symlink_to("f")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "f").read_bytes() == b"new"
    write_whole(tmp_path / ("x" * 255), [b"a", b"b"])
    assert (tmp_path / ("x" * 255)).read_bytes() == b"ab"
    device = tmp_path / "null"
    device.symlink_to("/dev/null")
    write_whole(device, b"gone")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"):
        write_whole(Path("/dev/full"), b"no")
    assert Path("/dev/full").is_char_device()


@pytest.mark.parametrize(
    "arguments",
    [
        ["train", "{in}/t.csv", "--rig", "{in}/rig.yaml", "--kind", "analytical", "--out", "{out}/m.pushmodel"],
        ["predict", "{in}/m", "--velocity", "0.02", "--contact", "0.1", "--angle", "0", "--json", "{out}/p.json"],
        ["simulate", "--shape", "rect1", "--surface", "abs", "--pushes", "1", "--speed", "0.02", "--out", "{out}/bag"],
    ],
)
def test_a_command_on_a_full_disk_ends_with_one_line(
    arguments: list[str],
    model: PushModel,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from push_predictor.recordings.rig import save_rig

    monkeypatch.setattr(progress, "PATIENCE", 600.0)  # no progress messages on a busy machine
    inside, out = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    out.mkdir()
    write_table(inside / "t.csv", table(30))
    save_rig(square_rig(), inside / "rig.yaml")
    save_model(model, inside / "m")
    arguments = [word.format(**{"in": inside, "out": out}) for word in arguments]
    with full_disk():
        status = main(arguments)
    text = capsys.readouterr().err
    assert status == 1 and text.count("\n") == 1, text
    assert arguments[-1] in text and "File too large" in text
    assert not list(out.iterdir())


# --- nodes --------------------------------------------------------------------------------------------------------


class Pipe:
    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, what: Any) -> None:
        self.sent.append(what)


def test_a_trace_reports_which_result_could_not_be_written(
    model: PushModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "push_predictor.residuals.trace.trace_data", lambda *_, **__: made_up_trace(slippery(0.1), count=30)
    )
    place = tmp_path / "result" / ".trace-x"
    place.mkdir(parents=True)
    task = trace_process.TraceTask((tmp_path / "bag",), tmp_path / "m", (), 0.01, place)
    with full_disk(), pytest.raises(OSError, match="File too large") as failure:
        trace_process.run_trace(Pipe(), task)  # type: ignore[arg-type]  # a pipe that records what it sends
    reason = f"[Errno 27] File too large: '{tmp_path}/result/trace.json'"
    assert trace_process.for_client(str(failure.value), task) == reason
    assert error_code(failure.value) == ErrorCode.INVALID_FILE
    assert not list(place.iterdir())
