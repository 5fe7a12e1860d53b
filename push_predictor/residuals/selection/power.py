# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The smallest detectable effect: how much a verdict of "nothing found" is worth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from push_predictor.models.mechanisms import mechanism_named
from push_predictor.residuals.candidates.candidate import HEADED, SIDES, Candidate
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, controls_for
from push_predictor.residuals.evidence.residualizer import sums_by
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.baseline import Baseline, difference
from push_predictor.residuals.selection.screening import TINY, Columns, Controlled, Scores, moments
from push_predictor.residuals.selection.search import SearchResult
from push_predictor.types import Array, IntArray

QUANTILE = 0.8416  # of the standard normal distribution, for a power of 80 %


def minimum_detectable(
    found: SearchResult, evidence: Evidence, inputs: InputsBasis, alpha: float, baseline: Baseline | None = None
) -> dict[str, Mapping[str, object]]:
    """By mechanism the size of a constant effect that is found with 80 % probability, its unit and covariate.

    The size is that in the mechanism's least favourable direction. Under "driven" that along the strongest covariate,
    per standard deviation of it. Sizes beyond what a rig can have are dropped: no plausible effect of that mechanism
    could have been found.
    """
    ordered = sorted(zip(found.first.statistic, found.candidates, strict=True), key=lambda pair: -pair[0])
    driven = [c for _, c in ordered if c.kind != "constant" and c.basis.name == "linear"]
    strongest = driven[0].covariate if driven else None
    chosen = [c for c in found.candidates if c.mechanism is not None and _is_reported(c, strongest)]
    threshold = found.first.threshold(alpha)
    kinds = {c.kind for c in chosen}
    seen = {kind: Controlled.of(found.unexplained, controls_for(kind, inputs), evidence.block) for kind in kinds}
    entries: dict[str, Mapping[str, object]] = {}
    for c in chosen:
        mechanism, value = mechanism_named(str(c.mechanism)), _size(c, seen[c.kind], threshold, baseline)
        if not mechanism.plausible(np.array([[value]])):
            continue
        entry = {"value": value, "unit": mechanism.parameters[0].unit, "covariate": c.covariate}
        if mechanism.name in entries:
            entry["per"] = f"standard deviation of {c.covariate}"
            entry = {**entries[mechanism.name], "driven": entry}
        entries[mechanism.name] = entry
    return entries


def _is_reported(candidate: Candidate, strongest: str | None) -> bool:
    constant = candidate.basis.is_constant and candidate.covariate in (CONSTANT, HEADED, SIDES)
    return constant or (candidate.covariate == strongest and candidate.basis.name == "linear")


def _size(candidate: Candidate, seen: Controlled, threshold: float, baseline: Baseline | None) -> float:
    """Norm of the coefficients, in units of the parameter, at which the power is 80 %."""
    columns = Columns(seen.residualizer(candidate.columns))
    raw = columns.scores(seen.blocks), columns.information
    against = baseline is not None and (baseline.judges(candidate) or baseline.compares(candidate))
    training = baseline.scores(candidate) if baseline is not None and against else None
    scores = raw[0].turned(columns.unit) if training is None else difference(raw, training)
    informations = [raw[1]] if training is None else [raw[1], training[1]]
    spread = sum(np.linalg.pinv(a, rcond=TINY, hermitian=True) for a in informations)
    if not scores.rows.shape[1] or not np.any(spread):
        return float("nan")
    length = _detectable_length(scores, threshold, _unevenness(columns.flat, seen.blocks.block))
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
