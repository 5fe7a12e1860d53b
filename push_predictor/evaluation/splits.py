"""Splits that keep every push whole, and the random split of rows that is only ever shown beside them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray

BOOTSTRAP_DRAWS = 1000
FOLDS = 5
RANDOM_TEST_ROWS = 1000
RANDOM_TEST_SHARE = 0.3  # of the rows, at most


@dataclass(frozen=True, eq=False)
class Split:
    """Indices of the rows to learn from, in the order in which they are drawn, and of the rows to test on."""

    training: IntArray
    test: IntArray

    def first(self, n: int) -> IntArray:
        """The first n rows to learn from: smaller training sets lie within larger ones."""
        return self.training[:n]


def split_by_push(table: PushTable, fold: int) -> Split:
    """Pushes dealt into 5 folds; the pushes of one fold are tested, rows are drawn from all others by rng(fold)."""
    folds = push_folds(table)
    others = np.flatnonzero(folds != fold)
    return Split(np.random.default_rng(fold).permutation(others), np.flatnonzero(folds == fold))


def random_split(table: PushTable, seed: int) -> Split:
    """1000 rows are tested (fewer of a small table), the same for every seed: windows of a push fall on both sides."""
    order = np.random.default_rng(0).permutation(len(table))
    tested = min(RANDOM_TEST_ROWS, int(RANDOM_TEST_SHARE * len(table)))
    return Split(np.random.default_rng(RANDOM_TEST_ROWS + seed).permutation(order[tested:]), order[:tested])


def push_folds(table: PushTable, folds: int = FOLDS, seed: int = 0) -> IntArray:
    """Fold number (n,) of every row; all rows of a push share it. Pushes are dealt by default_rng(seed)."""
    names, index = np.unique(table.push_id, return_inverse=True)
    numbers = np.empty(len(names), dtype=np.int64)  # of pushes in the order of their ids, "9" before "10"
    numbers[sorted(range(len(names)), key=lambda k: (len(names[k]), names[k]))] = np.arange(len(names))
    return np.asarray(np.random.default_rng(seed).permutation(len(names))[numbers[index]] % folds)


def push_bootstrap(push_id: np.ndarray, seed: int = 0, draws: int = BOOTSTRAP_DRAWS) -> Array:
    """Row weights (draws, n): how often each row's push was drawn when whole pushes are drawn with replacement."""
    pushes, index = np.unique(push_id, return_inverse=True)
    weights = np.random.default_rng(seed).multinomial(len(pushes), np.full(len(pushes), 1.0 / len(pushes)), size=draws)
    return weights[:, index].astype(np.float64)
