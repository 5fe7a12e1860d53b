# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models on pushes measured by others: prints the tables of docs/results/accuracy.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.measured --data FOLDER [--kind mcube|mit|mit-square] [--quick]

FOLDER has mcube_preliminary, mit_raw and mit_square. Everything is imported into a temporary folder and takes the path
of the command line: import, windows, train_model, compare. Only the random split separates windows of one push.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.measured.scores import HEAD, PLAIN, Fold, figures, pooled, total, trained
from benchmarks.measured.square import mit_square_tables
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.train import TrainingOptions
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import distinct_pushes, load_data, load_rig_for
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, WindowOptions
from push_predictor.types import Array

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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="the folder of the measured data")
    parser.add_argument("--kind", choices=tuple(TABLES), action="append", help="which tables; all if not given")
    parser.add_argument("--quick", action="store_true", help="mit-square: n = 100 only")
    options = parser.parse_args(arguments)
    for kind in options.kind or TABLES:
        with tempfile.TemporaryDirectory(prefix="measured_") as work:
            TABLES[kind](options.data, Path(work), options.quick)


# --- mcube ----------------------------------------------------------------------------------------------------


def mcube_tables(data: Path, work: Path, quick: bool) -> None:
    """Print the windows of the eight runs, and the models of each block on held-out runs."""
    runs = sorted(import_source("mcube", [data / "mcube_preliminary"], work).written)
    print("\n| run | windows | s in windows | tip, mm/s | path of the block, mm | turn, degrees |\n" + 6 * "|---" + "|")
    for run in runs:
        print(f"| {run.name} | {_summary(read_recording(run))} |")
    for prefix, name in BLOCKS.items():
        block = [run for run in runs if run.name.startswith(prefix)]
        print(f"\n{name}\n\n| model | trained on | {HEAD} | in domain, NMSE there | NMSE run by run |\n{10 * '|---'}|")
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


# --- mit ------------------------------------------------------------------------------------------------------


def mit_table(data: Path, work: Path, quick: bool) -> None:
    """Print the windows of the one push: observed and by the analytical model."""
    (path,) = import_source("mit", [data / "mit_raw"], work).written
    rig, table = load_rig_for([path]), load_data([path])
    for velocity, contact, angle in table.inputs:
        print(f"\nvelocity {1e3 * velocity:.0f} mm/s, contact {contact:.3f}, angle {np.degrees(angle):.1f} degrees")
    print("\n| | dx, mm | dy, mm | dtheta, degrees |\n|---|---|---|---|")
    print(_outcome_rows("observed", table.outcomes))
    physics = analytical_mechanics(rig.outline, rig.pusher_radius)
    print(_outcome_rows("analytical, textbook", physics.displacement(table.inputs, table.duration)))


def _outcome_rows(title: str, outcomes: Array) -> str:
    rows = outcomes * [1e3, 1e3, 180.0 / np.pi]
    return "\n".join(f"| {title} | {dx:.1f} | {dy:.1f} | {dtheta:.1f} |" for dx, dy, dtheta in rows)


TABLES: dict[str, Callable[[Path, Path, bool], None]] = {
    "mcube": mcube_tables,
    "mit": mit_table,
    "mit-square": mit_square_tables,
}
