# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Running NMSE, NLPD and coverage, at constant cost per window: the scores that diagnostics show every second."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from hashlib import blake2b

import numpy as np

from push_predictor.evaluation.metrics import COVERAGE_LEVELS, coverage, gaussian_nlpd
from push_predictor.models.predictors.tails import Tails, half_widths
from push_predictor.recordings.table import OUTPUTS
from push_predictor.types import Array


class RunningScore:
    """Running sums over the windows of one model.

    training_mean (3,): the reference of the NMSE. tails: of the model's predictive distribution.
    """

    def __init__(self, training_mean: Array, tails: Tails | None = None) -> None:
        self.windows = 0
        self._training_mean = training_mean
        self._half_widths = [half_widths(tails, level) for level in COVERAGE_LEVELS]
        self._pushes = array("q")  # digests of their names, in order: a set would take ten times as much
        self._error, self._spread, self._nlpd = np.zeros(3), np.zeros(3), np.zeros(3)
        self._covered = np.zeros((len(COVERAGE_LEVELS), 3))

    @property
    def pushes(self) -> int:
        """The number of pushes that the windows belong to."""
        return len(self._pushes)

    def add(self, push_id: str, mean: Array, covariance: Array, observed: Array) -> None:
        """Add a window: predicted mean (3,) and covariance (3, 3), observed outcome (3,)."""
        predicted, variance, outcome = mean[None], np.diagonal(covariance)[None], observed[None]
        self.windows += 1
        self._count_push(push_id)
        self._error += (observed - mean) ** 2
        self._spread += (observed - self._training_mean) ** 2
        self._nlpd += gaussian_nlpd(predicted, variance, outcome)[0]
        self._covered += [coverage(predicted, variance, outcome, half) for half in self._half_widths]

    def _count_push(self, push_id: str) -> None:
        digest = int.from_bytes(blake2b(push_id.encode(), digest_size=8).digest(), "little", signed=True)
        place = bisect_left(self._pushes, digest)
        if place == len(self._pushes) or self._pushes[place] != digest:
            self._pushes.insert(place, digest)

    def values(self) -> dict[str, int | float | None]:
        """The totals of `metrics_json` and the coverage of each output, by name; None where undefined."""
        found: dict[str, int | float | None] = {"windows": self.windows, "pushes": self.pushes}
        known = self.windows > 0 and bool(np.all(self._spread > 0.0))
        found["nmse"] = float(np.sum(self._error / self._spread)) if known else None
        found["nlpd"] = float(np.sum(self._nlpd) / self.windows) if self.windows else None
        for level, covered in zip(COVERAGE_LEVELS, self._covered, strict=True):
            shares = (float(c) / self.windows if self.windows else None for c in covered)
            found |= {f"coverage {level} {name}": share for name, share in zip(OUTPUTS, shares, strict=True)}
        return found
