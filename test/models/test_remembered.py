# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Results of the same rows are computed once, as long as they are few and recent."""

from __future__ import annotations

import numpy as np
import pytest

from push_predictor.models.remembered import MOST_ROWS, Remembered
from push_predictor.types import Array, IntArray


def test_predictions_are_computed_again_for_other_rows_only() -> None:
    asked = []

    def asked_for(rows: IntArray) -> Array:
        def predicted() -> Array:
            asked.append(rows.tolist())
            return rows.astype(np.float64)

        return remembered.of(predicted, rows)

    remembered: Remembered[Array] = Remembered()
    rows = np.array([0, 0, 1])
    first = asked_for(rows)
    assert asked_for(rows.copy()) is first
    rows[0] = 1  # the caller's array may change
    assert asked_for(rows).tolist() == [1.0, 0.0, 1.0]
    assert asked_for(np.array([0, 0, 1])) is first
    assert asked == [[0, 0, 1], [1, 0, 1]]
    for other in range(2, 6):  # the first is forgotten
        asked_for(np.array([other, other]))
    assert asked_for(np.array([0, 0, 1])) is not first


@pytest.mark.parametrize("rows", [1, MOST_ROWS + 1])
def test_a_planners_single_pushes_and_huge_batches_are_not_remembered(rows: int) -> None:
    remembered: Remembered[Array] = Remembered()
    first, again = (remembered.of(lambda: np.zeros(rows), np.zeros(rows)) for _ in range(2))
    assert first is not again
