"""By what name an effect goes: which drivers and which mechanisms these data leave open, and whether any fits.

A rival is struck off when, taken to be the truth and taken out, it leaves something over that the best explains. A
mechanism is named only if the generic fall-back with the same driver finds little beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.models.effects.effect import mechanism_named
from push_predictor.residuals.candidates.enumeration import Candidate
from push_predictor.residuals.evidence.residualizer import ResidualBlocks, Residualizer
from push_predictor.residuals.selection.cross_validation import Judged, fit, gains_of
from push_predictor.residuals.selection.screening import raw_scores, screen, unit_scores
from push_predictor.types import Array, IntArray

STRUCK_OFF = 0.01  # p below which a rival is not the truth
LEFT_OVER = 0.05  # p below which a mechanism leaves something over along its driver
MOST_LEFT = 0.15  # share of what can be explained along the driver that a named mechanism may leave over: it is linear


@dataclass(frozen=True, eq=False)
class Naming:
    """What the effect may be called, the best first. known: whether its mechanism is in the library.

    left_over: share of the gain along the driver that the best mechanism leaves to the generic fall-back.
    """

    drivers: tuple[str, ...]
    mechanisms: tuple[str | None, ...]
    known: bool
    left_over: float

    @property
    def undecided(self) -> bool:
        """Whether several drivers are left."""
        return len(self.drivers) > 1


@dataclass(frozen=True, eq=False)
class Case:
    """Residuals z (n, 3) with the basis (n, m) that goes out of everything, and the blocks (n,)."""

    z: Array
    basis: Array
    block: IntArray


def open_rivals(best: Judged, others: Sequence[Judged], case: Case, seed: int = 0) -> list[Judged]:
    """The best, and those of the others that could be the truth."""
    return [best, *(other for other in others if not _struck_off(best, other, case, seed))]


def plausible(candidate: Candidate, case: Case) -> bool:
    """Whether the size that fits is one that a rig can have; beyond it a mechanism only mimics another."""
    if candidate.mechanism is None:
        return True
    out = Residualizer(case.basis)
    coefficients = fit(out(candidate.columns), out(case.z)).reshape(candidate.response.shape[2], -1)
    values = np.ones((len(case.z), 1)) if candidate.values is None else candidate.values
    values = values - (values.mean(axis=0) if candidate.kind == "driven" and candidate.form.drivers else 0.0)
    size = np.quantile(np.abs(values @ coefficients.T), 0.9, axis=0)
    return mechanism_named(candidate.mechanism).plausible(size[None])


def leaves_over(mechanism: Judged, generic: Candidate, case: Case, seed: int = 0) -> float:
    """Share of the gain along the driver that a mechanism leaves to the fall-back; 0 where that is chance."""
    out = Residualizer(case.basis)
    both = _orthonormal(out(mechanism.candidate.columns))
    left, beside = _apart(out.left(case.z, case.block), both), _apart_from(out(generic.columns), both)
    if _p_value(left, beside, seed) > LEFT_OVER:
        return 0.0
    more = max(float(gains_of(left.left, beside, case.block).sum()), 0.0)
    return more / (more + max(mechanism.gain, np.finfo(float).tiny))


def _struck_off(best: Judged, other: Judged, case: Case, seed: int) -> bool:
    """Whether the other, taken out with the inputs, leaves over what the best explains."""
    out = Residualizer(case.basis)
    taken = _orthonormal(out(other.candidate.columns))
    left, flat = _apart(out.left(case.z, case.block), taken), _apart_from(out(best.candidate.columns), taken)
    return _p_value(left, flat, seed) <= STRUCK_OFF and best.gain > other.gain


def _p_value(left: ResidualBlocks, flat: Array, seed: int) -> float:
    scores = unit_scores(*raw_scores(left, flat))
    return float(screen([scores], seed).p_value[0]) if scores.rows.shape[1] else 1.0


def _orthonormal(flat: Array) -> Array:
    """Orthonormal columns (3 n, k) that span columns (n, 3, p)."""
    left, values, _ = np.linalg.svd(flat.reshape(-1, flat.shape[2]), full_matrices=False)
    return np.asarray(left[:, values > 1e-6 * max(values[0], np.finfo(float).tiny)])


def _apart(left: ResidualBlocks, taken: Array) -> ResidualBlocks:
    return ResidualBlocks(_apart_from(left.left, taken), _apart_from(left.enlarged, taken), left.block)


def _apart_from(values: Array, taken: Array) -> Array:
    """Values (n, 3, ...) less what the orthonormal columns (3 n, k) explain of them, all outputs together."""
    flat = values.reshape(len(taken), -1)
    return np.asarray(flat - taken @ (taken.T @ flat)).reshape(values.shape)
