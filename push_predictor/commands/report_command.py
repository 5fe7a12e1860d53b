"""push_predictor report: write an HTML page with figures, and its numbers as JSON."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.output import (
    add_command,
    add_rig,
    add_topics,
    check_output,
    progress,
    save_topics_of,
    topics_of,
    write_json,
    write_text,
)
from push_predictor.errors import PushPredictorError, RequestError

if TYPE_CHECKING:
    from push_predictor.models.push_model import PushModel

KINDS = ("vhgp", "gp", "analytical")
SPEEDS = (0.01, 0.02, 0.05)  # m/s
PAPER_IS_MISSING = (
    "`report paper` needs the package push_predictor_paper: pip install ./push_predictor_paper in the repository"
)
OPTIONS_OF_KIND = {"paper": ("data", "recordings", "jobs", "cluster"), "validation": ("model", "recording")}


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command `report`."""
    parser = add_command(
        commands,
        "report",
        "Write an HTML page with tables and figures. `report validation` compares models with a recording. Without "
        "--model and --recording it simulates a square on ABS and trains on that. `report paper` checks the claims of "
        "Bauza and Rodriguez (2017) on simulated pushes, with --data also on measured ones. An interrupted report "
        "continues from its results in DIR/work.",
        "push_predictor report validation --model square_abs.pushmodel --recording bags/square_abs_test --out report",
    )
    parser.add_argument("kind", choices=tuple(OPTIONS_OF_KIND), metavar="KIND", help="paper or validation")
    parser.add_argument("--quick", action="store_true", help="use few pushes, to test that it runs")
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="output folder")
    _add_paper_options(parser.add_argument_group("report paper"))
    _add_validation_options(parser.add_argument_group("report validation"))
    add_rig(parser)
    add_topics(parser)
    parser.set_defaults(run=run)


def _add_paper_options(paper: argparse._ArgumentGroup) -> None:
    paper.add_argument(
        "--data",
        type=Path,
        metavar="FOLDER",
        help="folder of measured pushes: mit_square, or files of the MIT push data set",
    )
    paper.add_argument(
        "--recordings", type=Path, metavar="FOLDER", help="keep the simulated recordings here (about 1 GB)"
    )
    paper.add_argument("--jobs", type=int, metavar="N", help="parallel jobs (default: one per core)")
    paper.add_argument(
        "--cluster", metavar="ADDRESS", help="address of a dask scheduler whose machines all see --out and --data"
    )


def _add_validation_options(validation: argparse._ArgumentGroup) -> None:
    validation.add_argument(
        "--model",
        type=Path,
        nargs="+",
        metavar="MODEL",
        help="model files; the report compares the others with the first",
    )
    validation.add_argument(
        "--recording", type=Path, metavar="RECORDING", help="a recording that was not used for training"
    )


def run(options: argparse.Namespace) -> None:
    """Compute the results and write the page."""
    for kind, names in OPTIONS_OF_KIND.items():
        for name in names:
            if kind != options.kind and getattr(options, name) is not None:
                raise RequestError(f"report {options.kind}", f"--{name}", f"it with `report {kind}` only")
    check_output("--out", options.out, folder=True)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.kind == "paper":
        _paper(options)
    else:
        _validation(options)


def _paper(options: argparse.Namespace) -> None:
    try:
        from push_predictor_paper.plan import FULL, QUICK
        from push_predictor_paper.report import report_paper
        from push_predictor_paper.work import Work
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package != "push_predictor_paper":
            raise PushPredictorError(f"`report paper` needs {package}; pip install ./push_predictor_paper") from None
        raise PushPredictorError(PAPER_IS_MISSING) from None
    from push_predictor.commands.progress_bar import ProgressBar

    if options.jobs is not None and options.jobs < 1:
        raise RequestError("--jobs", options.jobs, "an integer of at least 1")
    if options.data is not None and not options.data.is_dir():
        raise RequestError("--data", str(options.data), "a folder that exists")
    plan = QUICK if options.quick else FULL
    with _parallel(options.cluster), ProgressBar() as bar:
        work = Work(options.out.resolve() / "work", options.jobs or -1, bar)
        keep = None if options.recordings is None else options.recordings.resolve()
        page, content = report_paper(plan, work, options.out, options.data, keep, bar)
    if not write_json(options, {"report": str(page), **content}):
        print(page)


@contextmanager
def _parallel(cluster: str | None) -> Iterator[None]:
    """Send joblib's jobs to a dask scheduler, if one was given."""
    if cluster is None:
        yield
        return
    try:
        import joblib
        from distributed import Client
    except ImportError as error:
        raise PushPredictorError(f"--cluster needs dask ({error}); pip install 'dask[distributed]'") from None
    with Client(cluster, timeout="10s"), joblib.parallel_config(backend="dask"):
        yield


def _validation(options: argparse.Namespace) -> None:
    import json

    from push_predictor.evaluation.offline import report_recording
    from push_predictor.models.store.model_file import load_model
    from push_predictor.recordings.rig import load_rig

    if (options.model is None) != (options.recording is None):
        missing = "--model" if options.model is None else "--recording"
        raise RequestError(missing, "missing", "both --model and --recording, or neither")
    rig = load_rig(options.rig) if options.rig else None
    with progress("report"):
        if options.model is None:
            models, recording = _simulated(options.out, 60 if options.quick else 300)
        else:
            models, recording = [load_model(path) for path in options.model], options.recording
        page, metrics = report_recording(models, recording, options.out, rig, topics_of(options))
        save_topics_of(options, [recording])
    write_text(options.out / "validation.json", json.dumps(metrics, indent=2) + "\n")
    if not write_json(options, {"report": str(page), "models": metrics}):
        print(page)


def _simulated(out: Path, pushes: int) -> tuple[list[PushModel], Path]:
    """Models trained on one simulated recording, and a second recording to test them on."""
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
