# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Normal scores depend on ranks only."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.special import ndtri
from scipy.stats import rankdata

from push_predictor.normal_scores import normal_scores
from push_predictor.types import Array

FEW_VALUES = st.integers(-3, 3).map(float)  # so that many are equal


@given(arrays(np.float64, array_shapes(min_dims=1, max_dims=2, min_side=1, max_side=20), elements=FEW_VALUES))
def test_normal_scores_are_those_of_average_ranks(values: Array):
    np.testing.assert_allclose(normal_scores(values), ndtri((rankdata(values, axis=0) - 0.5) / len(values)))


def test_column_with_nan_has_no_scores():
    scores = normal_scores(np.array([[1.0, 1.0], [np.nan, 2.0], [3.0, np.inf]]))
    assert np.isnan(scores[:, 0]).all()
    np.testing.assert_allclose(scores[:, 1], ndtri([1 / 6, 1 / 2, 5 / 6]), atol=1e-15)


def test_normal_scores_depend_on_order_only():
    values = np.random.default_rng(0).standard_normal((30, 3))
    assert np.array_equal(normal_scores(values), normal_scores(np.exp(values)))
