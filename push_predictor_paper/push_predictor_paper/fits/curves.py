# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scores by training size, cell by cell, and their means over seeds and pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from push_predictor.evaluation.estimate import Figure as Statistic
from push_predictor.evaluation.push_scores import PushScores, pooled
from push_predictor_paper.data.corpus import Corpus, Pair
from push_predictor_paper.fits.fit import SPLITS, Fit, Score, SplitName, scores
from push_predictor_paper.study import Study

Cell = tuple[Pair, str, SplitName, int]  # pair, kind of model, split, training windows
OTHER_SEEDS = 3  # draws of the random split on pairs other than the reference


@dataclass(frozen=True, eq=False)
class Curves:
    """Scores of all seeds (folds, by push) by cell; cells that a set is too small for are missing."""

    cells: Mapping[Cell, tuple[Score, ...]]

    def sizes(self, pairs: Sequence[Pair], kind: str, split: SplitName) -> tuple[int, ...]:
        """The training sizes that all these pairs have."""
        held = [{n for p, k, s, n in self.cells if (p, k, s) == (pair, kind, split)} for pair in pairs]
        return tuple(sorted(set.intersection(*held))) if held else ()

    def values(self, pairs: Sequence[Pair], kind: str, split: SplitName, n: int, measure: Statistic) -> list[float]:
        """Mean of a measure over pairs, seed by seed."""
        cells = [self.cells[pair, kind, split, n] for pair in pairs]
        rows = [[float(measure(score.push_scores.totals())[0]) for score in cell] for cell in cells]
        return [float(np.mean(seed)) for seed in zip(*rows, strict=False)]  # the reference pair has more seeds

    def push_scores(self, pair: Pair, kind: str, split: SplitName, n: int) -> PushScores:
        """Scores of the pushes of all seeds together."""
        return pooled([score.push_scores for score in self.cells[pair, kind, split, n]])


def curves(study: Study, corpus: Corpus, pairs: Sequence[Pair], kinds: Sequence[str]) -> Curves:
    """Train and score these kinds on these pairs at all sizes, on both splits.

    The reference pair has the largest size as well, and all draws of the random split.
    """
    plan, fits = study.plan, []
    for pair in pairs:
        reference = pair == corpus.reference
        sizes = [*plan.sizes, *([plan.largest] if reference and plan.largest is not None else [])]
        for kind, split, n in product(kinds, SPLITS, sizes):
            seeds = plan.seeds if reference or split == "push" else min(plan.seeds, OTHER_SEEDS)
            fits += [(pair, Fit(kind, n, split, seed)) for seed in range(seeds)]
    return gathered(fits, scores(study.work, corpus, fits))


def gathered(fits: Sequence[tuple[Pair, Fit]], found: Mapping[tuple[Pair, Fit], Score]) -> Curves:
    """Scores by cell; incomplete cells are dropped, so that a curve's end does not lose its small folds."""
    cells: dict[Cell, list[Score | None]] = {}
    for pair, fit in fits:
        cells.setdefault((pair, fit.kind, fit.split, fit.n), []).append(found.get((pair, fit)))
    whole = {cell: [score for score in seeds if score is not None] for cell, seeds in cells.items()}
    return Curves({cell: tuple(seeds) for cell, seeds in whole.items() if len(seeds) == len(cells[cell])})
