"""A figure with its 95 % interval by drawing whole pushes anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.push_scores import PooledScores, PushScores
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.types import Array

Figure = Callable[[PooledScores], Array]  # (d,) of d draws


@dataclass(frozen=True)
class Estimate:
    """A figure and its 95 % interval; low and high are NaN where the data do not tell."""

    value: float
    low: float
    high: float

    def text(self, form: str = ".2f") -> str:
        """For a sentence: 0.12 (0.10 to 0.14)."""
        return f"{self._told(self.value, form)} ({self._ends(form)})"

    def cell(self, form: str = ".2f") -> str:
        """For a table: the interval beneath the figure."""
        return f"{self._told(self.value, form)}\n{self._ends(form)}"

    def json(self) -> dict[str, float | None]:
        """For the JSON: null where nothing is known."""
        return {name: (v if np.isfinite(v) else None) for name, v in vars(self).items()}

    def _ends(self, form: str) -> str:
        return f"{self._told(self.low, form)} to {self._told(self.high, form)}"

    @staticmethod
    def _told(value: float, form: str) -> str:
        return format(value, form).replace("-", "−") if np.isfinite(value) else "–"


def of_draws(value: float, draws: Array) -> Estimate:
    """A figure with the central 95 % of its draws (d,)."""
    low, high = np.quantile(draws, [0.025, 0.975])
    return Estimate(float(value), float(low), float(high))


def by_push(push_scores: PushScores, figure: Figure) -> Estimate:
    """A figure of the pushes of a push_scores, by drawing whole pushes anew."""
    return of_draws(float(figure(push_scores.totals())[0]), figure(push_scores.resampled()))


def difference_by_push(first: PushScores, second: PushScores, figure: Figure) -> Estimate:
    """The second's figure less the first's, of the same pushes drawn together."""
    weights = push_bootstrap(first.push_id)
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
