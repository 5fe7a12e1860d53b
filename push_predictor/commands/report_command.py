# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor report: write an HTML page with figures, and its numbers as JSON."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Commands, Option, command
from push_predictor.commands.common.options import OUT_FOLDER, READING, Reading, model_argument
from push_predictor.commands.common.output import check_folder, warn, write_json, write_text
from push_predictor.commands.common.progress import progress
from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.watch import Watch, part_of, watched

if TYPE_CHECKING:
    from push_predictor.models.push_model import PushModel

KINDS = ("vhgp", "gp", "analytical")
SPEEDS = (0.01, 0.02, 0.05)  # m/s
VALIDATION_EXAMPLE = (
    "push_predictor report validation square_abs.pushmodel --recording bags/square_abs_test --out report"
)
PAPER_IS_MISSING = (
    "`report paper` needs the package push_predictor_paper: pip install ./push_predictor_paper in the repository"
)
FEW_PUSHES = Option("--quick", action="store_true", help="use few pushes, to test that it runs")


class Report:
    """The command `report`, with a command for each kind."""

    def add_to(self, commands: Commands) -> None:
        """Add its parser to those of the commands."""
        summary = (
            "Write an HTML page with tables and figures. Both kinds take --quick, --out PATH, --force, --json FILE|-."
        )
        parser = commands.add_parser(
            "report",
            help=summary.partition(". ")[0],
            description=summary,
            epilog=f"example:\n  {VALIDATION_EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
        for kind in (validation, paper):
            kind.add_to(kinds)


run = Report()


@command(
    "paper",
    "Check the claims of Bauza and Rodriguez (2017). Uses simulated pushes, with --data also measured ones. An "
    "interrupted report continues from its results in the folder work of --out.",
    "push_predictor report paper --quick --out paper",
    Option(
        "--data",
        type=Path,
        metavar="FOLDER",
        help="folder of measured pushes: mit_square, or files of the MIT push data set",
    ),
    Option("--recordings", type=Path, metavar="FOLDER", help="keep the simulated recordings here (about 1 GB)"),
    Option("--jobs", type=int, metavar="N", help="parallel jobs (default: one per core)"),
    FEW_PUSHES,
    OUT_FOLDER,
)
def paper(options: argparse.Namespace) -> None:
    """Check the claims of the paper and write the page."""
    _make_folder(options, ("paper.html", "paper.json"))
    try:
        from push_predictor_paper.plan import FULL, QUICK
        from push_predictor_paper.report import report_paper
        from push_predictor_paper.work import Work
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package != "push_predictor_paper":
            raise PushPredictorError(f"`report paper` needs {package}; pip install ./push_predictor_paper") from None
        raise PushPredictorError(PAPER_IS_MISSING) from None
    if options.jobs is not None and options.jobs < 1:
        raise RequestError("--jobs", options.jobs, "an integer of at least 1")
    if options.data is not None and not options.data.is_dir():
        raise RequestError("--data", str(options.data), "a folder that exists")
    plan = QUICK if options.quick else FULL
    with progress("report paper") as watch:
        work = Work(options.out.resolve() / "work", options.jobs or -1)
        keep = None if options.recordings is None else options.recordings.resolve()
        page, content = report_paper(plan, work, options.out, options.data, keep, watch)
    if not write_json(options, {"report": str(page), **content}):
        print(page)
        print("claims:", ", ".join(f"{verdict} {count}" for verdict, count in content["verdicts"].items()))


@command(
    "validation",
    "Compare models with a recording. Without MODEL and --recording it simulates a square on ABS and trains on that.",
    VALIDATION_EXAMPLE,
    model_argument("*", note="; the report compares the others with the first"),
    Option(
        "--recording",
        type=Path,
        metavar="RECORDING",
        help="a recording; give one that was not used for training",
    ),
    FEW_PUSHES,
    OUT_FOLDER,
    *READING,
)
def validation(options: argparse.Namespace) -> None:
    """Compare models with a recording and write the page."""
    import json

    from push_predictor.evaluation.offline import report_recording
    from push_predictor.models.store.model_file import load_model

    if bool(options.model) != (options.recording is not None):
        missing = "--recording" if options.model else "MODEL"
        raise RequestError(missing, "missing", "both MODEL and --recording, or neither")
    simulated = () if options.model else ("train", "test")
    _make_folder(options, ("report.html", "report.json", "validation.json", *simulated))
    reading = Reading(options)
    with progress("report") as watch:
        if not options.model:
            models, recording = _simulated(options.out, 60 if options.quick else 300, part_of(watch, 0.0, 0.5))
            watch = part_of(watch, 0.5, 1.0)
        else:
            models, recording = [load_model(path) for path in options.model], options.recording
        rig, topics, checks = reading.rig, reading.topics, reading.checks
        page, metrics = report_recording(
            models, recording, options.out, rig, topics, watch=watch, report=warn, checks=checks
        )
        reading.save_topics([recording])
    write_text(options.out / "validation.json", json.dumps(metrics, indent=2) + "\n")
    if not write_json(options, {"report": str(page), "models": metrics}):
        print(page)


def _make_folder(options: argparse.Namespace, outputs: Sequence[str]) -> None:
    check_folder("--out", options.out, outputs, force=options.force)
    options.out.mkdir(parents=True, exist_ok=True)


def _simulated(out: Path, pushes: int, watch: Watch) -> tuple[list[PushModel], Path]:
    """Models trained on one simulated recording, and a second recording to test them on."""
    import numpy as np

    from push_predictor.models.train import train_model
    from push_predictor.recordings.load import load_data, load_rig_for
    from push_predictor.recordings.write import write_recording
    from push_predictor.simulation.pushes import random_pushes
    from push_predictor.simulation.rig_simulator import SimulationSpec, simulate

    recordings = (("train", 1, pushes), ("test", 2, max(20, pushes // 5)))
    for name, seed, count in watched(recordings, part_of(watch, 0.0, 0.3), "simulated recording"):
        plan = random_pushes(count, SPEEDS, 0.02, np.random.default_rng([seed, 0]))
        write_recording(out / name, simulate(SimulationSpec("rect1", "abs", plan, seed=seed, name=name)))
    train = [out / "train"]
    table, rig = load_data(train), load_rig_for(train)
    models = [
        train_model(table, rig, kind, name=kind, sources=["simulated train"])
        for kind in watched(KINDS, part_of(watch, 0.3, 1.0), "trained model")
    ]
    return models, out / "test"
