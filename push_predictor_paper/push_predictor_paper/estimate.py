# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Intervals over seeds, in addition to the library's intervals by push."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from push_predictor.evaluation.estimate import (
    Estimate,
    Figure,
    by_push,
    difference_by_push,
    of_draws,
    total_exact_nlpd,
    total_nlpd,
    total_nmse,
)

__all__ = [
    "Estimate",
    "Figure",
    "by_push",
    "difference_by_push",
    "of_draws",
    "over_seeds",
    "total_exact_nlpd",
    "total_nlpd",
    "total_nmse",
]


def over_seeds(values: Sequence[float]) -> Estimate:
    """Mean of a figure over seeds or folds, with Student's interval of that mean."""
    mean, count = float(np.mean(values)), len(values)
    if count < 2:
        return Estimate(mean, np.nan, np.nan)
    half = float(student.ppf(0.975, count - 1) * np.std(values, ddof=1) / np.sqrt(count))
    return Estimate(mean, mean - half, mean + half)
