# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor info: describe a file and list what is damaged."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Option, Output, command
from push_predictor.commands.common.options import RIG, TOPICS, Reading
from push_predictor.commands.common.output import write_json
from push_predictor.errors import RequestError

if TYPE_CHECKING:
    from push_predictor.types import Array


UNITS = {"velocity_range": "m/s", "angle_range": "rad"}
BIAS_UNITS = {
    **dict.fromkeys(("force", "force_sd", "weight", "weight_sd"), "N"),
    **dict.fromkeys(("torque", "torque_sd", "lever"), "N m"),
    "seconds": "s",
}


@command(
    "info",
    "Describe a recording, push table or model file. Lists what is damaged.",
    "push_predictor info bags/square_abs_test",
    Option(
        "file", type=Path, metavar="FILE", help="a recording, push table or model file, or default: the shipped model"
    ),
    RIG,
    Output("--rig-out", type=Path, metavar="FILE.yaml", help="write the rig; it is that of the push_rig record"),
    TOPICS,
)
def run(options: argparse.Namespace) -> None:
    """Describe the file and print the description."""
    from push_predictor.recordings.describe import describe_recording, describe_table
    from push_predictor.recordings.table_file import is_recording
    from push_predictor.resources import model_path

    path: Path = model_path(options.file)
    if not path.exists():
        raise FileNotFoundError(2, "no such file or folder", str(path))
    if options.rig_out is not None:
        _write_rig(options)
    if is_recording(path):
        reading = Reading(options)
        found = describe_recording(path, reading.topics, reading.rig)
        reading.save_topics([path])
    elif path.name.endswith((".csv", ".csv.gz")):
        found = describe_table(path)
    else:
        found = _describe_model(path)
    if not write_json(options, found):
        _print(found)


def _write_rig(options: argparse.Namespace) -> None:
    """Write the recorded rig, whatever --rig is. Raises RigError for a recording without one."""
    from push_predictor.recordings.load import required_rig
    from push_predictor.recordings.rig import save_rig
    from push_predictor.recordings.table_file import is_recording

    if not is_recording(options.file):
        raise RequestError("--rig-out", str(options.rig_out), f"it with a recording: {options.file} is none")
    save_rig(required_rig(options.file), options.rig_out)
    print(f"rig: {options.rig_out}", file=sys.stderr)


def _describe_model(path: Path) -> dict[str, object]:
    from push_predictor.models.push_model import mean_of, mean_parameters
    from push_predictor.models.store.model_file import load_model

    model = load_model(path)
    velocity, _, angle = model.training.inputs.T
    return {
        "model": model.name,
        "kind": model.kind,
        "shape": model.rig.shape,
        "surface": model.rig.surface,
        "windows": len(model.training),
        "pushes": model.provenance.pushes,
        "sources": list(model.provenance.sources),
        "written_by": model.provenance.version,
        "mean": mean_of(model.predictor),
        "mean_parameters": mean_parameters(model.predictor),
        "velocity_range": _range(velocity),
        "angle_range": _range(angle),
        "covariates": list(model.training.covariates),
        "needs": list(model.needs),
        "defaults": dict(model.defaults),
        "time_origin": model.predictor.session.origin,
        "covariate_ranges": {name: [known.low, known.high] for name, known in model.covariate_ranges.items()},
    }


def _range(column: Array) -> list[float] | None:
    return [float(column.min()), float(column.max())] if len(column) else None


def _print(found: Mapping[str, object]) -> None:
    width = max(map(len, found))
    for key, value in found.items():
        if isinstance(value, (list, tuple)):
            value = _listed(value)
        if isinstance(value, dict):
            units = BIAS_UNITS if key == "wrench_bias" else {}
            lines = (f"\n  {name}: {_entry(entry)} {units.get(name, '')}".rstrip(" ") for name, entry in value.items())
            value = "".join(lines) or "none"
        if value is None:
            value = "none"
        unit = f" {UNITS[key]}" if key in UNITS and value != "none" else ""
        print(f"{key:{width}s}  {value}{unit}")


def _listed(values: Sequence[object]) -> str:
    return ", ".join(f"{value:.4g}" if isinstance(value, float) else str(value) for value in values) or "none"


def _entry(entry: object) -> object:
    return _listed(entry if isinstance(entry, (list, tuple)) else [entry])
