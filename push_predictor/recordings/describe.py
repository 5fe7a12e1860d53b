# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Summaries of recordings and push tables, including damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from push_predictor.recordings.fields.wrench_bias import WrenchBias
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.table_file import read_table, rig_of_table
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import find_windows


def describe_recording(path: Path, topics: Topics = Topics(), rig: Rig | None = None) -> dict[str, object]:
    """Streams, rig, pushes and windows of a recording. Raises RecordingError for an unreadable file.

    rig: instead of the recorded one.
    """
    recording = read_recording(path, rig=rig, topics=topics)
    found: dict[str, object] = {"recording": recording.name, "rig": _rig(recording), "streams": _streams(recording)}
    if recording.wrench_bias is not None:
        found["wrench_bias"] = _bias(recording.wrench_bias)
    if recording.rig is not None:
        windows = find_windows(recording, recording.rig)
        found |= {"pushes": len({w.push_id for w in windows}), "windows": len(windows)}
    return found | {"notes": list(recording.notes)}


def describe_table(path: Path) -> dict[str, object]:
    """Rows, pushes and ranges of a push table. Raises TableError."""
    table, rig = read_table(path), rig_of_table(path)
    columns = np.column_stack([table.inputs, table.duration])
    names = ("velocity", "contact", "angle", "duration")
    ranges = {
        name: f"{low:.4g} to {high:.4g}"
        for name, low, high in zip(names, columns.min(axis=0), columns.max(axis=0), strict=True)
    }
    return {
        "table": path.name,
        "rows": len(table),
        "pushes": len(table.pushes),
        "rig": "none (no .rig.yaml file)" if rig is None else f"{rig.shape} on {rig.surface}",
        "ranges": ranges,
        "covariates": list(table.covariates),
    }


def _rig(recording: Recording) -> str:
    rig = recording.rig
    if rig is None:
        return "none: give it to the commands that need it, with --rig"
    mass = "mass not given" if rig.object_mass is None else f"{rig.object_mass:g} kg"
    return f"{rig.shape} on {rig.surface}, {mass}"


def _bias(bias: WrenchBias) -> dict[str, object]:
    found = {
        key: value.tolist() if isinstance(value, np.ndarray) else value
        for key, value in vars(bias).items()
        if value is not None
    }
    return {"axes": "of the sensor", **found}


def _streams(recording: Recording) -> dict[str, str]:
    streams: dict[str, PoseStream | WrenchStream | ScalarStream | None] = {
        "slider": recording.slider,
        "pusher": recording.pusher,
        "wrench": recording.wrench,
        **recording.scalars,
    }
    return {name: _extent(stream) for name, stream in streams.items()}


def _extent(stream: PoseStream | WrenchStream | ScalarStream | None) -> str:
    if stream is None or not len(stream):
        return "absent"
    seconds = (int(stream.stamp[-1]) - int(stream.stamp[0])) * 1e-9
    rate = (len(stream) - 1) / seconds if seconds > 0.0 else 0.0
    return f"{len(stream)} samples, {seconds:.2f} s, {rate:.1f} Hz"
