# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The range of a covariate in the training data, beyond which a prediction that needs it is out of domain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.effects.covariates import CUMULATIVE as CUMULATIVE  # re-exported, as HEADINGS
from push_predictor.models.effects.covariates import HEADINGS as HEADINGS
from push_predictor.types import Array, BoolArray

WHOLE_TURN = np.radians(30.0)  # headings with no wider gap between them cover the whole turn
MARGIN = 1e-6  # relative: a model file keeps seven digits
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class CovariateRange:
    """A range from low to high. For a heading it runs counter-clockwise from low, and high may exceed pi."""

    low: float
    high: float
    heading: bool = False

    def contains(self, values: Array) -> BoolArray:
        """Which of the values (n,) lie in the range."""
        least, most = self._ends
        if self.heading:
            values = least + (values - least) % TURN
        return np.asarray((values >= least) & (values <= most))

    def reaching(self, value: float) -> CovariateRange:
        """The range, raised so that it contains this value."""
        return replace(self, high=max(self.high, value))

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """The ends, margin included."""
        margin = MARGIN * max(abs(self.low), abs(self.high))
        return self.low - margin, self.high + margin

    def __str__(self) -> str:
        return f"{self.low:.4g} to {self.high:.4g}"


def range_of(name: str, values: Array) -> CovariateRange:
    """The range of the values (n,) of a covariate; for a heading the shortest arc that contains them all."""
    if name not in HEADINGS:
        return CovariateRange(float(values.min()), float(values.max()))
    around = np.sort(values % TURN)
    gaps = np.diff(around, append=around[0] + TURN)
    widest = int(np.argmax(gaps))
    if gaps[widest] <= WHOLE_TURN:
        return CovariateRange(-np.pi, np.pi, heading=True)
    low = float(around[(widest + 1) % len(around)])
    low -= TURN * (low >= np.pi)
    return CovariateRange(low, low + TURN - float(gaps[widest]), heading=True)
