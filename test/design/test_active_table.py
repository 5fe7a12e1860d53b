# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of the study of suggested pushes: numbers of pushes that a score needs, and what is resampled."""

from __future__ import annotations

import numpy as np

from benchmarks.models.active_table import DRAWS, needed, resampled

SIZES = np.array([5.0, 10.0, 20.0])


def test_is_where_the_line_crosses_the_target_for_the_first_time() -> None:
    scores = np.array([[1.0, 0.5, 0.1], [0.2, 0.9, 0.1], [1.0, 0.9, 0.8], [1.0, 0.2, 0.4]])
    np.testing.assert_allclose(needed(SIZES, scores, np.full(4, 0.3)), [15.0, 5.0, np.inf, 9.375])


def test_pools_are_resampled_as_wholes_and_then_their_pushes() -> None:
    drawn = resampled([30, 50], np.random.default_rng(1))
    assert drawn.shape == (DRAWS, 80)
    pools = np.column_stack([drawn[:, :30].sum(axis=1) / 30, drawn[:, 30:].sum(axis=1) / 50])
    assert {tuple(row) for row in pools.tolist()} == {(0.0, 2.0), (1.0, 1.0), (2.0, 0.0)}
    np.testing.assert_allclose(drawn.mean(axis=0), 1.0, atol=0.15)


def test_pushes_of_one_group_are_resampled_alone() -> None:
    drawn = resampled([40], np.random.default_rng(1))
    assert set(drawn.sum(axis=1)) == {40.0} and drawn.max() > 1.0
