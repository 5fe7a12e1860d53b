"""Splits that keep every push whole, and the random split of rows that is only ever shown beside them."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray, IntArray

BOOTSTRAP_DRAWS = 1000


def push_folds(table: PushTable, folds: int = 5, seed: int = 0) -> IntArray:
    """Fold number (n,) of every row; all rows of a push share it. Pushes are dealt by default_rng(seed)."""
    pushes, index = np.unique(table.push_id, return_inverse=True)
    return np.asarray(np.random.default_rng(seed).permutation(len(pushes))[index] % folds)


def held_out_pushes(table: PushTable, share: float, seed: int = 0) -> BoolArray:
    """Mask (n,) of the rows of a random share of the pushes, at least one."""
    pushes, index = np.unique(table.push_id, return_inverse=True)
    count = max(1, round(share * len(pushes)))
    return np.asarray(np.random.default_rng(seed).permutation(len(pushes))[index] < count)


def push_bootstrap(push_id: np.ndarray, seed: int = 0, draws: int = BOOTSTRAP_DRAWS) -> Array:
    """Row weights (draws, n): how often each row's push was drawn when whole pushes are drawn with replacement."""
    pushes, index = np.unique(push_id, return_inverse=True)
    weights = np.random.default_rng(seed).multinomial(len(pushes), np.full(len(pushes), 1.0 / len(pushes)), size=draws)
    return weights[:, index].astype(np.float64)
