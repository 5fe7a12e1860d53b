"""The smallest effect that the search would have found: what "nothing found" is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from push_predictor.models.effects.effect import mechanism_named
from push_predictor.residuals.candidates.enumeration import HEADED, SIDES, Candidate
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, inputs_of
from push_predictor.residuals.evidence.residualizer import Residualizer, sums_by
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.selection.baseline import Baseline, difference
from push_predictor.residuals.selection.forward_selection import Search
from push_predictor.residuals.selection.screening import TINY, Scores, moments, raw_scores, unit_scores
from push_predictor.types import Array, IntArray

SURE = 0.8416  # standard normal quantile of a power of 80 %


@dataclass(frozen=True)
class Detectable:
    """A size found with 80 % probability, in the mechanism's least favourable direction.

    covariate: what drives it; the size is then that per standard deviation of the driver.
    """

    mechanism: str
    covariate: str
    value: float
    unit: str


def minimum_detectable(
    found: Search, evidence: Evidence, basis: InputsBasis, alpha: float, baseline: Baseline | None = None
) -> list[Detectable]:
    """For every mechanism: the size of a constant effect, then that along the strongest driver, where one varies.

    What would have to be larger than any rig has it is left out: no such effect would have been found.
    """
    ordered = sorted(zip(found.first.statistic, found.candidates, strict=True), key=lambda pair: -pair[0])
    driven = [c for _, c in ordered if c.kind != "constant" and c.form.name == "linear"]
    strongest = driven[0].covariate if driven else None
    chosen = [c for c in found.candidates if c.mechanism is not None and _wanted(c, strongest)]
    threshold = found.first.threshold(alpha)
    sizes = [(c, _size(c, found.left, evidence, basis, threshold, baseline)) for c in chosen]
    return [
        Detectable(str(c.mechanism), c.covariate, value, _unit(c))
        for c, value in sizes
        if mechanism_named(str(c.mechanism)).plausible(np.array([[value]]))  # larger ones no rig has
    ]


def detectable_json(sizes: list[Detectable]) -> dict[str, Mapping[str, object]]:
    """By mechanism, as the contract has it: value and unit of the constant effect; along a driver beside it."""
    told: dict[str, Mapping[str, object]] = {}
    for size in sizes:
        entry = {"value": size.value, "unit": size.unit, "covariate": size.covariate}
        if size.mechanism in told:
            entry["per"] = f"standard deviation of {size.covariate}"
        told[size.mechanism] = {**told[size.mechanism], "driven": entry} if size.mechanism in told else entry
    return told


def _wanted(candidate: Candidate, strongest: str | None) -> bool:
    constant = candidate.form.name == "constant" and candidate.covariate in (CONSTANT, HEADED, SIDES)
    return constant or (candidate.covariate == strongest and candidate.form.name == "linear")


def _unit(candidate: Candidate) -> str:
    return mechanism_named(str(candidate.mechanism)).parameters[0].unit


def _size(
    candidate: Candidate,
    left: Array,
    evidence: Evidence,
    basis: InputsBasis,
    threshold: float,
    baseline: Baseline | None,
) -> float:
    """Norm of the coefficients, in units of the parameter, at which the statistic passes the threshold surely."""
    out = Residualizer(inputs_of(candidate.kind, basis))
    flat = out(candidate.columns)
    raw = raw_scores(out.left(left, evidence.block), flat)
    against = baseline is not None and (baseline.applies(candidate) or baseline.stands(candidate))
    training = baseline.scores(candidate) if baseline is not None and against else None
    scores = unit_scores(*raw) if training is None else difference(raw, training)
    informations = [raw[1]] if training is None else [raw[1], training[1]]
    spread = sum(np.linalg.pinv(a, rcond=TINY, hermitian=True) for a in informations)
    if not scores.rows.shape[1] or not np.any(spread):
        return float("nan")
    return _noncentral(scores, threshold, _unevenness(flat, evidence.block)) * float(
        np.sqrt(np.linalg.eigvalsh(spread)[-1])
    )


def _noncentral(scores: Scores, threshold: float, unevenness: float) -> float:
    """Length of the mean score whose square sum passes the threshold with 80 %; see screening for the scale.

    An effect adds to the bootstrap's scatter too, the more, the fewer blocks there are; infinite where it never passes.
    """
    scale = moments(scores)
    if scale is None:
        return float("nan")
    unit, freedom = scale
    share, mean = 2.0 / (9.0 * freedom), unit * freedom
    critical = mean * max(1.0 - share + threshold * np.sqrt(share), 0.0) ** 3
    worst = float(np.linalg.eigvalsh(scores.rows.T @ scores.rows)[-1])
    gain = 1.0 - critical / mean * unevenness  # of the square sum, less what it adds to the critical value
    need = max(critical - mean, 0.0)
    return (
        float((SURE * np.sqrt(worst) + np.sqrt(SURE**2 * worst + gain * need)) / gain) if gain > 0.0 else float("inf")
    )


def _unevenness(flat: Array, block: IntArray) -> float:
    """Sum of the squared shares of the blocks in the information of columns (n, 3, p): 1 / b where all are alike."""
    information = sums_by(block, np.sum(flat**2, axis=(1, 2))[:, None])[:, 0]
    return float(np.sum(information**2) / max(information.sum() ** 2, np.finfo(float).tiny))
