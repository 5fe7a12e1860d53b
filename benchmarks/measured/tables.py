# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models on pushes measured by others: prints the tables of docs/results/accuracy.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.measured --data FOLDER [--kind mcube|mit-square] [--quick]

FOLDER has mcube_preliminary and mit_square. Everything is imported into a temporary folder and takes the path
of the command line: import, windows, train_model, compare. Only the random split separates windows of one push.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.measured.scores import HEAD, PLAIN, Fold, figures, pooled, total, trained
from benchmarks.measured.square import mit_square_tables
from benchmarks.support.scripts import parser_of, ruled
from push_predictor.models.train import TrainingOptions
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import distinct_pushes, load_data, load_rig_for
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions

BLOCKS = {"Al": "aluminium", "St": "steel"}
STRIDE = 0.02  # s between the starts of overlapping training windows
MCUBE_MODELS = (  # kind, fitted physics, stride of the training windows
    ("analytical", False, None),
    ("analytical", True, None),
    ("gp", False, None),
    ("vhgp", False, None),
    ("gp", False, STRIDE),
    ("vhgp", False, STRIDE),
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables as Markdown."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="the folder of the measured data")
    parser.add_argument("--kind", choices=tuple(TABLES), action="append", help="which tables; all if not given")
    parser.add_argument("--quick", action="store_true", help="mit-square: n = 100 only")
    options = parser.parse_args(arguments)
    for kind in options.kind or TABLES:
        with tempfile.TemporaryDirectory(prefix="measured_") as work:
            TABLES[kind](options.data, Path(work), options.quick)


def mcube_tables(data: Path, work: Path, quick: bool) -> None:
    """Print the windows of the eight runs, and the models of each block on held-out runs."""
    runs = sorted(import_source("mcube", [data / "mcube_preliminary"], work).written)
    print("\n" + ruled("| run | windows | s in windows | tip, mm/s | path of the block, mm | turn, degrees |"))
    for run in runs:
        print(f"| {run.name} | {_summary(read_recording(run))} |")
    for prefix, name in BLOCKS.items():
        block = [run for run in runs if run.name.startswith(prefix)]
        head = f"| model | trained on | {HEAD} | in domain, NMSE there | NMSE run by run |"
        print(f"\n{name}\n\n{ruled(head)}")
        for kind, fit, stride in MCUBE_MODELS:
            print(_leave_one_out_row(block, kind, fit, stride), flush=True)


def leave_one_run_out(
    runs: Sequence[Path], kind: str, options: TrainingOptions = PLAIN, stride: float | None = None
) -> list[Fold]:
    """For every run, a model trained on the other runs. stride (s) overlaps training windows; test windows tile."""
    rig, windows = load_rig_for(runs), WindowOptions(stride=stride)
    tiled = [load_data([run]) for run in runs]
    training = tiled if stride is None else [load_data([run], None, windows) for run in runs]
    return [trained(_without(k, runs, training), tiled[k], rig, kind, options) for k in range(len(runs))]


def _without(k: int, runs: Sequence[Path], tables: Sequence[PushTable]) -> PushTable:
    """The tables of all runs but one, as load_data gives them: it would read each run again for every other."""
    others = [j for j in range(len(runs)) if j != k]
    return concatenate(distinct_pushes([runs[j].name for j in others], [tables[j] for j in others]))


def mean_speed(recording: Recording, start: int, end: int) -> float:
    """Speed (m/s) of the tip between two stamps (ns), along the chord."""
    tip = recording.pusher
    chord = [np.diff(np.interp([start, end], tip.stamp, column))[0] for column in (tip.x, tip.y)]
    return float(np.hypot(*chord)) / ((end - start) * 1e-9)


def travelled(windows: Sequence[PushWindow]) -> tuple[float, float]:
    """Path length (m) of the slider from window to window, and the sum (rad) of its turns."""
    moved = np.array([window.displacement for window in windows])
    return float(np.hypot(*moved[:, :2].T).sum()), float(moved[:, 2].sum())


def _summary(recording: Recording) -> str:
    windows = find_windows(recording, require_rig(recording))
    way, turn = travelled(windows)
    seconds = sum(window.duration for window in windows)
    speed = 1e3 * mean_speed(recording, windows[0].start, windows[-1].end)
    return f"{len(windows)} | {seconds:.1f} | {speed:.0f} | {1e3 * way:.0f} | {np.degrees(turn):.0f}"


def _leave_one_out_row(runs: Sequence[Path], kind: str, fit: bool, stride: float | None) -> str:
    folds = leave_one_run_out(runs, kind, replace(PLAIN, fit=fit), stride)
    counts = [len(fold.model.training) for fold in folds]
    inside, there = np.concatenate([fold.in_domain for fold in folds]), _nmse_in_domain(folds)
    by_run = " ".join(f"{total(fold.push_scores, 'nmse'):.2f}" for fold in folds)
    title = f"{kind}, fitted" if fit else kind
    rows = f"{min(counts)} to {max(counts)}{' overlapping' if stride else ''}"
    return f"| {title} | {rows} | {figures(pooled(folds))} | {inside.mean():.0%}, {there:.2f} | {by_run} |"


def _nmse_in_domain(folds: Sequence[Fold]) -> float:
    """NMSE of the windows in the domain of their model, summed over the outputs."""
    rows = [(fold.comparison, fold.in_domain) for fold in folds]
    error = np.concatenate([(c.observed - c.mean)[inside] ** 2 for c, inside in rows])
    spread = np.concatenate([(c.observed - c.training_mean)[inside] ** 2 for c, inside in rows])
    return float(np.sum(error.sum(axis=0) / spread.sum(axis=0)))


TABLES: dict[str, Callable[[Path, Path, bool], None]] = {
    "mcube": mcube_tables,
    "mit-square": mit_square_tables,
}
