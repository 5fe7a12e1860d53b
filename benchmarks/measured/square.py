# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The measured square of the MIT set: analytical model, GP and VHGP by n, on a random split and by push."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from push_predictor_paper.data.corpus import PushSet
from push_predictor_paper.fits.fit import KINDS, Fit, Score, SplitName, score

from benchmarks.measured.scores import HEAD, difference, figures
from benchmarks.support.scripts import ruled
from push_predictor.evaluation.push_scores import pooled
from push_predictor.evaluation.splits import FOLDS
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.load import load_data, load_rig_for

SIZES = (100, 200, 500, 1000)
SPLITS: tuple[tuple[SplitName, str], ...] = (("random", "random split"), ("push", "split by push"))


def mit_square_tables(data: Path, work: Path, quick: bool) -> None:
    """Print a table for each split."""
    pushes = imported_square(data, work)
    for split, name in SPLITS:
        head = f"| model | n | {HEAD} | NMSE, NLPD: mean of {FOLDS} | CPU, s |"
        print(f"\n{name}\n\n{ruled(head)}")
        for n in SIZES[:1] if quick else SIZES:
            scores = {kind: square_scores(pushes, kind, n, split) for kind in KINDS}
            for kind in KINDS:
                print(f"| {kind} | {n} | {_cells(scores[kind])} |", flush=True)
            gp, vhgp = (pooled([s.push_scores for s in scores[kind]]) for kind in ("gp", "vhgp"))
            print(f"| vhgp minus gp | {n} | {difference(gp, vhgp)} | | |", flush=True)


def imported_square(data: Path, work: Path) -> PushSet:
    """The rows of `import mit-square`."""
    import_source("mit-square", [data / "mit_square" / "pushes_3500.npz"], work)
    path = work / "pushes_3500.csv"
    return PushSet(load_data([path]), load_rig_for([path]))


def square_scores(pushes: PushSet, kind: str, n: int, split: SplitName) -> list[Score]:
    """A model of n rows for each fold, or as many seeds of the random split."""
    return [score(pushes, Fit(kind, n, split, k)) for k in range(FOLDS)]


def _cells(scores: list[Score]) -> str:
    totals = [s.push_scores.totals() for s in scores]
    nmse, nlpd = np.mean([t.nmse.sum() for t in totals]), np.mean([t.nlpd.sum() for t in totals])
    cpu = np.mean([s.cpu for s in scores])
    return f"{figures(pooled([s.push_scores for s in scores]))} | {nmse:.3f}, {nlpd:.2f} | {cpu:.2f}"
