# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The smallest detectable effect: how much a verdict of "nothing found" is worth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.models.mechanisms import mechanism_named
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.inputs_basis import InputsBasis
from push_predictor.residuals.evidence.residualizer import sums_by
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.gate import Baseline, Seen, difference
from push_predictor.residuals.selection.screening import TINY, Scores, moments
from push_predictor.residuals.selection.search import SearchResult
from push_predictor.types import Array, IntArray

QUANTILE = 0.8416  # of the standard normal distribution, for a power of 80 %


def minimum_detectable(
    found: SearchResult, evidence: Evidence, inputs: InputsBasis, alpha: float, baseline: Baseline
) -> dict[str, Mapping[str, object]]:
    """By mechanism the size of a constant effect that is found with 80 % probability, its unit and covariate.

    The size is that in the mechanism's least favourable direction. Sizes beyond what a rig can have are dropped: no
    plausible effect of that mechanism could have been found.
    """
    chosen = [c for c in found.candidates if c.mechanism is not None and c.basis.is_constant]
    threshold = found.first.threshold(alpha)
    seen = Seen(inputs, found.unexplained, evidence.block)
    entries: dict[str, Mapping[str, object]] = {}
    for c in chosen:
        mechanism, value = mechanism_named(str(c.mechanism)), _size(c, seen, threshold, baseline)
        if not mechanism.plausible(np.array([[value]])):
            continue
        entries[mechanism.name] = {"value": value, "unit": mechanism.parameters[0].unit, "covariate": c.covariate}
    return entries


def _size(candidate: Candidate, seen: Seen, threshold: float, baseline: Baseline) -> float:
    """Norm of the coefficients, in units of the parameter, at which the power is 80 %."""
    columns = seen.columns(candidate)
    raw = seen.scores(candidate, columns), columns.information
    against = baseline.judges(candidate) or baseline.compares(candidate)
    training = baseline.scores(candidate) if against else None
    scores = raw[0].turned(columns.unit) if training is None else difference(raw, training)
    informations = [raw[1]] if training is None else [raw[1], training[1]]
    spread = sum(np.linalg.pinv(a, rcond=TINY, hermitian=True) for a in informations)
    if not scores.rows.shape[1] or not np.any(spread):
        return float("nan")
    length = _detectable_length(scores, threshold, _unevenness(columns.flat, seen.block))
    return length * float(np.sqrt(np.linalg.eigvalsh(spread)[-1]))


def _detectable_length(scores: Scores, threshold: float, unevenness: float) -> float:
    """Length of the mean score whose sum of squares exceeds the threshold with 80 % probability.

    An effect widens the bootstrap distribution too, the more so the fewer blocks there are; infinite if the sum never
    exceeds the threshold.
    """
    scale = moments(scores)
    if scale is None:
        return float("nan")
    unit, freedom = scale
    share, mean = 2.0 / (9.0 * freedom), unit * freedom
    critical = mean * max(1.0 - share + threshold * np.sqrt(share), 0.0) ** 3
    worst = float(np.linalg.eigvalsh(scores.rows.T @ scores.rows)[-1])
    gain = 1.0 - critical / mean * unevenness  # of the sum of squares, minus the increase of the critical value
    if gain <= 0.0:
        return float("inf")
    need = max(critical - mean, 0.0)
    return float((QUANTILE * np.sqrt(worst) + np.sqrt(QUANTILE**2 * worst + gain * need)) / gain)


def _unevenness(columns: Array, block: IntArray) -> float:
    """Sum of the squared shares of the blocks in the information of columns (n, 3, p); 1 / b if all are equal."""
    information = sums_by(block, np.sum(columns**2, axis=(1, 2))[:, None])[:, 0]
    return float(np.sum(information**2) / max(information.sum() ** 2, np.finfo(float).tiny))
