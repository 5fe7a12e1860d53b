# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Splits into training and test data, and resamples, that keep pushes whole."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray

BOOTSTRAP_DRAWS = 1000
FOLDS = 5


@dataclass(frozen=True, eq=False)
class Split:
    """Indices of the training rows, in the order in which they are drawn, and of the test rows."""

    training: IntArray
    test: IntArray

    def first(self, n: int) -> IntArray:
        """The first n training rows, so that smaller training sets are contained in larger ones."""
        return self.training[:n]


def split_by_push(table: PushTable, fold: int) -> Split:
    """Test the pushes of one of 5 folds; draw training rows from the others with default_rng(fold)."""
    folds = push_folds(table)
    others = np.flatnonzero(folds != fold)
    return Split(np.random.default_rng(fold).permutation(others), np.flatnonzero(folds == fold))


def push_folds(table: PushTable, folds: int = FOLDS, seed: int = 0) -> IntArray:
    """Fold number (n,) of every row, equal for all rows of a push; assigned with default_rng(seed)."""
    names, index = np.unique(table.push_id, return_inverse=True)
    numbers = np.empty(len(names), dtype=np.int64)  # pushes in the order of their ids, "9" before "10"
    numbers[sorted(range(len(names)), key=lambda k: (len(names[k]), names[k]))] = np.arange(len(names))
    return np.asarray(np.random.default_rng(seed).permutation(len(names))[numbers[index]] % folds)


def push_bootstrap(push_id: np.ndarray, seed: int = 0, draws: int = BOOTSTRAP_DRAWS) -> Array:
    """Row weights (draws, n): how often each row's push occurs when whole pushes are resampled."""
    pushes, index = np.unique(push_id, return_inverse=True)
    return np.asarray(_times_drawn(len(pushes), seed, draws)[:, index], dtype=np.float64)


@lru_cache(maxsize=2)  # a page resamples the same pushes for each of its intervals
def _times_drawn(pushes: int, seed: int, draws: int) -> IntArray:
    """How often (draws, p) each of p pushes occurs when as many are drawn at random."""
    times = np.random.default_rng(seed).multinomial(pushes, np.full(pushes, 1.0 / pushes), size=draws)
    return times.astype(np.uint16)  # kept: a quarter of the memory
