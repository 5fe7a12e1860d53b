"""The number of pushes that a score needs, as the study of suggested pushes reports it."""

from __future__ import annotations

import numpy as np

from benchmarks.models.active_table import needed

SIZES = np.array([5.0, 10.0, 20.0])


def test_is_where_the_line_crosses_the_target_for_the_first_time() -> None:
    scores = np.array([[1.0, 0.5, 0.1], [0.2, 0.9, 0.1], [1.0, 0.9, 0.8], [1.0, 0.2, 0.4]])
    np.testing.assert_allclose(needed(SIZES, scores, np.full(4, 0.3)), [15.0, 5.0, np.inf, 9.375])
