# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The name of an effect: which covariates and which mechanisms remain possible, and whether any mechanism fits.

A rival is rejected if the best candidate still explains something after the rival has been regressed out. A mechanism
is named only if the generic polynomial along the same covariate explains little in addition to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from push_predictor.models.mechanisms import mechanism_named
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.residualizer import ResidualBlocks, Residualizer
from push_predictor.residuals.selection.cross_validation import Judged, fit, gains_of
from push_predictor.residuals.selection.screening import raw_scores, screen, unit_scores
from push_predictor.types import Array, IntArray

REJECTED = 0.01  # p below which a rival is rejected
UNEXPLAINED = 0.05  # p below which a mechanism fails to explain something along its covariate
MOST_UNEXPLAINED = 0.15  # largest share along the covariate that a named mechanism may fail to explain


@dataclass(frozen=True, eq=False)
class Naming:
    """Possible covariates and mechanisms of an effect, the best first; known: whether a mechanism of the library fits.

    unexplained: share of the gain along the covariate that only the generic polynomial achieves. resembles: where no
    mechanism fits, the one that comes closest.
    """

    drivers: tuple[str, ...]
    mechanisms: tuple[str | None, ...]
    known: bool
    unexplained: float
    resembles: str | None = None

    @property
    def undecided(self) -> bool:
        """Whether several covariates remain possible."""
        return len(self.drivers) > 1


@dataclass(frozen=True, eq=False)
class Case:
    """Residuals z (n, 3), the controls (n, m) to regress out, and the block (n,) of every window."""

    z: Array
    controls: Array
    block: IntArray


def open_rivals(best: Judged, others: Sequence[Judged], case: Case, seed: int = 0) -> list[Judged]:
    """The best, and those of the others that these data do not reject."""
    return [best, *(other for other in others if not _rejected(best, other, case, seed))]


def plausible(judged: Judged, case: Case) -> bool:
    """Whether the fitted size is one that a rig can have; with a larger one a mechanism only mimics another."""
    candidate, case = judged.candidate, _seen_by(judged, case)
    if candidate.mechanism is None:
        return True
    residualizer = Residualizer(case.controls)
    coefficients = fit(residualizer(candidate.columns), residualizer(case.z))
    values = np.ones((len(case.z), 1)) if candidate.values is None else candidate.values
    values = values - (values.mean(axis=0) if candidate.kind == "driven" and candidate.basis.drivers else 0.0)
    strength = values @ coefficients.reshape(candidate.response.shape[2], -1).T
    return mechanism_named(candidate.mechanism).plausible(np.quantile(np.abs(strength), 0.9, axis=0)[None])


def surely_larger(one: Judged, other: Judged, level: float = REJECTED) -> bool:
    """Whether a gain is larger by more than chance from block to block; level: probability of such a chance."""
    more = Judged(one.candidate, one.gains - other.gains)
    return more.gain > -float(ndtri(level)) * more.error


def unexplained_share(mechanism: Judged, generic: Candidate, case: Case, seed: int = 0) -> float:
    """Share of the gain along the covariate that only the generic polynomial achieves; 0 if that may be chance."""
    case = _seen_by(mechanism, case)
    blocks, columns = _given(mechanism.candidate, generic, case)
    if _p_value(blocks, columns, seed) > UNEXPLAINED:
        return 0.0
    more = max(float(gains_of(blocks.residual, columns, case.block).sum()), 0.0)
    return more / (more + max(mechanism.gain, np.finfo(float).tiny))


def _rejected(best: Judged, other: Judged, case: Case, seed: int) -> bool:
    """Whether the best still explains something once the other is regressed out.

    Of exact fits, whether the best one's gain is larger by more than chance from block to block.
    """
    if best.exact and other.exact:
        return surely_larger(best, other)
    blocks, columns = _given(other.candidate, best.candidate, _seen_by(other, case))
    return _p_value(blocks, columns, seed) <= REJECTED and best.gain > other.gain


def _seen_by(judged: Judged, case: Case) -> Case:
    """The case with the target of an exact fit in place of the residuals."""
    return case if judged.exact is None else replace(case, z=judged.exact.target)


def _given(first: Candidate, second: Candidate, case: Case) -> tuple[ResidualBlocks, Array]:
    """The residuals, and the columns (n, 3, p) of the second candidate, with controls and the first regressed out."""
    residualizer = Residualizer(case.controls)
    taken = _orthonormal(residualizer(first.columns))
    columns = residualizer(second.columns)
    flat = columns.reshape(len(taken), -1)
    apart = (flat - taken @ (taken.T @ flat)).reshape(columns.shape)
    return residualizer.blocks(case.z, case.block).orthogonal_to(taken), np.asarray(apart)


def _p_value(blocks: ResidualBlocks, columns: Array, seed: int) -> float:
    scores = unit_scores(*raw_scores(blocks, columns))
    return float(screen([scores], seed).p_value[0]) if scores.rows.shape[1] else 1.0


def _orthonormal(columns: Array) -> Array:
    """Orthonormal columns (3 n, k) that span columns (n, 3, p)."""
    left, values, _ = np.linalg.svd(columns.reshape(-1, columns.shape[2]), full_matrices=False)
    return np.asarray(left[:, values > 1e-6 * max(values[0], np.finfo(float).tiny)])
