"""push_predictor report: HTML with pictures, JSON beside it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.output import add_command, progress, write_json, write_text
from push_predictor.errors import RequestError

if TYPE_CHECKING:
    from push_predictor.models.push_model import PushModel

KINDS = ("vhgp", "gp", "analytical")
SPEEDS = (0.01, 0.02, 0.05)


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """The sub-command `report`."""
    parser = add_command(
        commands,
        "report",
        "A page with tables and pictures: models against a recording they were not trained on. Without --model and "
        "--recording, both are made by the rig simulator (a square on abs).",
        "push_predictor report validation --model square_abs.pushmodel --recording bags/square_abs_test --out report",
    )
    parser.add_argument("kind", choices=("validation",), metavar="KIND", help="validation")
    parser.add_argument("--model", type=Path, nargs="+", metavar="MODEL", help="model files; the first is the main one")
    parser.add_argument("--recording", type=Path, metavar="RECORDING", help="held out from training")
    parser.add_argument("--quick", action="store_true", help="simulate a fifth of the pushes")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="folder that receives the report")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Compare and write the page."""
    import json

    from push_predictor.evaluation.offline import report_recording
    from push_predictor.models.model_file import load_model

    if (options.model is None) != (options.recording is None):
        missing = "--model" if options.model is None else "--recording"
        raise RequestError(missing, None, "both --model and --recording, or neither")
    options.out.mkdir(parents=True, exist_ok=True)
    with progress("report"):
        if options.model is None:
            models, recording = _simulated(options.out, 60 if options.quick else 300)
        else:
            models, recording = [load_model(path) for path in options.model], options.recording
        page, metrics = report_recording(models, recording, options.out)
    write_text(options.out / "validation.json", json.dumps(metrics, indent=2) + "\n")
    if not write_json(options, {"report": str(page), "models": metrics}):
        print(page)


def _simulated(out: Path, pushes: int) -> tuple[list[PushModel], Path]:
    """Models trained on one simulated recording, and another one to try them on."""
    import numpy as np

    from push_predictor.models.train import train_model
    from push_predictor.recordings.load import load_data, load_rig_for
    from push_predictor.recordings.write import write_recording
    from push_predictor.simulation.pushes import random_pushes
    from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

    for name, seed, count in (("train", 1, pushes), ("test", 2, max(20, pushes // 5))):
        plan = random_pushes(count, SPEEDS, 0.02, np.random.default_rng([seed, 0]))
        write_recording(out / name, simulate(SimulationSpec("rect1", "abs", plan, seed=seed, name=name)))
    train = [out / "train"]
    table, rig = load_data(train), load_rig_for(train)
    models = [train_model(table, rig, kind, name=kind, sources=["simulated train"]) for kind in KINDS]
    return models, out / "test"
