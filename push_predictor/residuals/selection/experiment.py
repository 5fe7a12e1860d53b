"""Pushes that would separate rivals: where their predictions differ most, with their covariates set apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanisms import Push
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.types import Array

PUSHES = 4
OWN = ("velocity", "contact", "angle")  # inputs of a push, which the operator sets anyway


def separating_pushes(evidence: Evidence, rivals: Sequence[Effect]) -> tuple[Mapping[str, float], ...]:
    """Pushes (velocity, contact, angle and the rivals' covariates) that would separate the first rival from the others.

    Each was already made at other values of the covariates: now one rival's covariate is at the low end of its range
    and the other's at the high end. Empty without rivals.
    """
    if len(rivals) < 2:
        return ()
    chosen: list[Mapping[str, float]] = []
    for other in rivals[1:]:
        chosen += _separating(evidence, rivals[0], other)
    return tuple(chosen[:PUSHES])


def _separating(evidence: Evidence, first: Effect, second: Effect) -> list[Mapping[str, float]]:
    """The pushes at which two rivals differ most, one rival's covariate low and the other's high, and vice versa."""
    table, pushes = evidence.table, []
    for low, high in ((first, second), (second, first)):
        covariates = dict(table.covariates)
        for rival, share in ((low, 0.05), (high, 0.95)):
            for driver in rival.basis.drivers:
                if driver not in OWN:
                    covariates[driver] = np.full(len(table), np.quantile(table.covariates[driver], share))
        shifts = [_shift(evidence, covariates, rival) for rival in (first, second)]
        best = int(np.argmax(np.sum((shifts[0] - shifts[1]) ** 2, axis=1)))
        pushes.append(_push(evidence, covariates, best, (first, second)))
    return pushes


def _shift(evidence: Evidence, covariates: Mapping[str, Array], rival: Effect) -> Array:
    """Standardised shift of the outcome (n, 3) by a rival."""
    push = Push(evidence.table.inputs, evidence.table.duration, covariates)
    return np.asarray(np.einsum("nij,nj->ni", evidence.whitener, joint_shift(evidence.mechanics, [rival], push)))


def _push(
    evidence: Evidence, covariates: Mapping[str, Array], row: int, rivals: Sequence[Effect]
) -> Mapping[str, float]:
    """One push by name: its inputs, then the covariates of the rivals and the slider's heading."""
    velocity, contact, angle = (float(value) for value in evidence.table.inputs[row])
    drivers = dict.fromkeys(name for rival in rivals for name in rival.basis.drivers if name not in OWN)
    if "slider_heading" in covariates:
        drivers["slider_heading"] = None
    inputs = {"velocity": velocity, "contact": contact, "angle": angle}
    return {**inputs, **{name: float(covariates[name][row]) for name in drivers}}
