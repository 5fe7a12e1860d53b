"""The measured square of the MIT set: analytical model, GP and VHGP over n, on a random split and by push."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.measured_scores import HEAD, Fold, difference, figures, pooled, total, trained
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import IntArray

SIZES = (100, 200, 500, 1000)
KINDS = ("analytical", "gp", "vhgp")
TEST_ROWS = 1000
FOLDS = 5  # and as many seeds of the random split
Split = Callable[[PushTable, int], "tuple[IntArray, IntArray, int]"]


def mit_square_tables(data: Path, work: Path, quick: bool) -> None:
    """Print a table for each split."""
    table, rig = imported_square(data, work)
    for name, split in (("random split", random_split), ("split by push", split_by_push)):
        print(f"\n{name}\n\n| model | n | {HEAD} | NMSE, NLPD: mean of {FOLDS} | CPU, s |\n{10 * '|---'}|")
        for n in SIZES[:1] if quick else SIZES:
            folds = {kind: square_folds(split, table, rig, kind, n) for kind in KINDS}
            for kind in KINDS:
                print(f"| {kind} | {n} | {_cells(folds[kind])} |", flush=True)
            print(f"| vhgp less gp | {n} | {difference(pooled(folds['gp']), pooled(folds['vhgp']))} | | |", flush=True)


def imported_square(data: Path, work: Path) -> tuple[PushTable, Rig]:
    """The rows as `import mit-square` writes them."""
    import_source("mit-square", [data / "mit_square" / "pushes_3500.npz"], work)
    path = work / "pushes_3500.csv"
    return load_data([path]), load_rig_for([path])


def random_split(table: PushTable, seed: int) -> tuple[IntArray, IntArray, int]:
    """Rows to draw the training rows from, test rows, seed of that draw: windows of one push fall on both sides."""
    order = np.random.default_rng(0).permutation(len(table))
    return order[TEST_ROWS:], order[:TEST_ROWS], TEST_ROWS + seed


def split_by_push(table: PushTable, fold: int) -> tuple[IntArray, IntArray, int]:
    """The same with whole pushes, numbered in the order of their ids."""
    push = np.unique(table.push_id.astype(np.int64), return_inverse=True)[1]
    folds = np.random.default_rng(0).permutation(push.max() + 1)[push] % FOLDS
    return np.flatnonzero(folds != fold), np.flatnonzero(folds == fold), fold


def square_folds(split: Split, table: PushTable, rig: Rig, kind: str, n: int) -> list[Fold]:
    """A model of n rows for each seed or fold."""
    parts = [split(table, k) for k in range(FOLDS)]
    return [trained(table.take(a), table.take(b), rig, kind, n=n, seed=seed) for a, b, seed in parts]


def _cells(folds: list[Fold]) -> str:
    nmse, nlpd = (np.mean([total(fold.comparison, key) for fold in folds]) for key in ("nmse", "nlpd"))
    return f"{figures(pooled(folds))} | {nmse:.3f}, {nlpd:.2f} | {np.mean([fold.cpu for fold in folds]):.2f}"
