# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A statistic with its 95 % confidence interval from resampling whole pushes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.push_scores import PooledScores, PushScores, samples_of
from push_predictor.types import Array

NORMAL_95 = 1.96  # standard deviations on either side of the mean that cover 95 % of a Gaussian
Figure = Callable[[PooledScores], Array]  # returns (d,) for d bootstrap samples


@dataclass(frozen=True)
class Estimate:
    """A statistic and its 95 % interval; low and high are NaN if the data do not determine it."""

    value: float
    low: float
    high: float

    def times(self, factor: float) -> Estimate:
        """The statistic times a factor."""
        low, high = (
            (factor * self.low, factor * self.high) if factor >= 0.0 else (factor * self.high, factor * self.low)
        )
        return Estimate(factor * self.value, low, high)

    def size(self) -> Estimate:
        """The statistic without its sign."""
        return self.times(-1.0) if self.value < 0.0 else self

    def text(self, form: str = ".2f") -> str:
        """Text for a sentence: 0.12 (0.10 to 0.14)."""
        return f"{self._text(self.value, form)} ({self._ends(form)})"

    def cell(self, form: str = ".2f") -> str:
        """Text for a table cell: the interval on a second line."""
        return f"{self._text(self.value, form)}\n{self._ends(form)}"

    def json(self) -> dict[str, float | None]:
        """Values for the JSON: None if undetermined."""
        return {name: (v if np.isfinite(v) else None) for name, v in vars(self).items()}

    def _ends(self, form: str) -> str:
        return f"{self._text(self.low, form)} to {self._text(self.high, form)}"

    @staticmethod
    def _text(value: float, form: str) -> str:
        return format(value, form).replace("-", "−") if np.isfinite(value) else "–"


def of_draws(value: float, draws: Array) -> Estimate:
    """An estimate from a value and its bootstrap samples (d,); without samples, low and high are NaN."""
    low, high = np.quantile(draws, [0.025, 0.975]) if len(draws) else (np.nan, np.nan)
    return Estimate(float(value), float(low), float(high))


def by_push(scores: PushScores, figure: Figure) -> Estimate:
    """A statistic of these pushes with its interval from resampling whole pushes."""
    return of_draws(float(figure(scores.totals())[0]), figure(scores.resampled()))


def difference_by_push(first: PushScores, second: PushScores, figure: Figure) -> Estimate:
    """The second's statistic minus the first's, with the interval from resampling the same pushes for both."""
    weights = samples_of(first.push_id)
    value = figure(second.totals())[0] - figure(first.totals())[0]
    return of_draws(float(value), figure(second.totals(weights)) - figure(first.totals(weights)))


def total_nmse(totals: PooledScores) -> Array:
    """NMSE summed over the outputs, (d,)."""
    return np.asarray(totals.nmse.sum(axis=1))


def total_nlpd(totals: PooledScores) -> Array:
    """NLPD summed over the outputs, moment-matched Gaussian, SI units, (d,)."""
    return np.asarray(totals.nlpd.sum(axis=1))


def total_exact_nlpd(totals: PooledScores) -> Array:
    """NLPD summed over the outputs, exact predictive density, SI units, (d,)."""
    return np.asarray(totals.exact_nlpd.sum(axis=1))
