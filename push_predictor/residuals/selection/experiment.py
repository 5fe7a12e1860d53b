"""Pushes that would tell rivals apart: where they differ most, with their drivers set against each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanisms import Push
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.enumeration import Candidate
from push_predictor.residuals.evidence.standardised import Evidence, evidence_scale
from push_predictor.types import Array

PUSHES = 4
OWN = ("velocity", "contact", "angle")  # inputs of a push; they are set, not waited for


def separating_pushes(evidence: Evidence, rivals: Sequence[tuple[Candidate, Array]]) -> tuple[Mapping[str, float], ...]:
    """Pushes (velocity, contact, angle, and the covariates that the rivals take) that would separate rivals.

    rivals: candidates with their coefficients (p,), the best first. Each push was made already with other values of
    the drivers: the first rival's driver is set to one end of its range while the second's stays at the other. Empty
    where there is no rival.
    """
    if len(rivals) < 2:
        return ()
    chosen: list[Mapping[str, float]] = []
    for other in rivals[1:]:
        chosen += _apart(evidence, rivals[0], other)
    return tuple(chosen[:PUSHES])


def _apart(
    evidence: Evidence, first: tuple[Candidate, Array], second: tuple[Candidate, Array]
) -> list[Mapping[str, float]]:
    """The push at which the two differ most with the first's driver low and the second's high, and the other way."""
    table = evidence.table
    pushes = []
    for low, high in ((first, second), (second, first)):
        covariates = dict(table.covariates)
        for (candidate, _), share in ((low, 0.05), (high, 0.95)):
            for driver in candidate.form.drivers:
                if driver not in OWN:
                    covariates[driver] = np.full(len(table), np.quantile(table.covariates[driver], share))
        shifts = [_shift(evidence, table, covariates, rival) for rival in (first, second)]
        best = int(np.argmax(np.sum((shifts[0] - shifts[1]) ** 2, axis=1)))
        pushes.append(_told(table, covariates, best, (first[0], second[0])))
    return pushes


def _shift(
    evidence: Evidence, table: PushTable, covariates: Mapping[str, Array], rival: tuple[Candidate, Array]
) -> Array:
    """What a rival adds to the outcome (n, 3), in units of the predicted deviation."""
    candidate, coefficients = rival
    count = len(coefficients)
    effect = Effect(
        candidate.mechanism,
        candidate.covariate,
        candidate.form,
        coefficients,
        np.zeros((count, count)),
        evidence_scale(evidence),
    )
    shift, _ = effect.shift(evidence.physics, Push(table.inputs, table.duration, covariates))
    return np.einsum("nij,nj->ni", evidence.whitener, shift)


def _told(
    table: PushTable, covariates: Mapping[str, Array], row: int, candidates: Sequence[Candidate]
) -> Mapping[str, float]:
    velocity, contact, angle = (float(value) for value in table.inputs[row])
    told = {"velocity": velocity, "contact": contact, "angle": angle}
    drivers = dict.fromkeys(name for c in candidates for name in c.form.drivers if name not in OWN)
    if "slider_heading" in covariates:
        drivers["slider_heading"] = None
    return {**told, **{name: float(covariates[name][row]) for name in drivers}}
