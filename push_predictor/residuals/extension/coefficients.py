"""The coefficients of effects, estimated jointly on standardised residuals, with their covariance.

What a learnt base could express in its own inputs is regressed out of residuals and responses first (Frisch and Waugh
1933). The covariance is a jackknife over blocks of pushes: it covers disturbances that neighbouring pushes share, and
coefficients that depend on a few pushes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.predictors import Cross
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, evidence_scale
from push_predictor.residuals.selection.cross_validation import RIDGE
from push_predictor.types import Array, IntArray


def estimated_effects(
    evidence: Evidence, candidates: Sequence[Candidate], own_inputs: Array | None = None
) -> tuple[tuple[Effect, ...], Cross]:
    """The effects of these candidates, and the covariances between their coefficients (see ExtendedPredictor).

    own_inputs (n, m): controls to regress out of residuals and responses.
    """
    designs = [candidate.plain for candidate in candidates]
    columns, n = np.concatenate(designs, axis=2), len(evidence.table)
    residualizer = Residualizer(np.empty((n, 0)) if own_inputs is None else own_inputs)
    # Relative to the whole column, not to its residual: what the inputs explain of it must not be blown up.
    ridge = RIDGE * np.sum(columns**2, axis=(0, 1)) + 1e-12
    coefficients, covariance = _least_squares(residualizer(columns), residualizer(evidence.z), evidence.block, ridge)
    covariance *= n / max(n - residualizer.q.shape[1], 1)
    ends = np.cumsum([0, *(design.shape[2] for design in designs)])
    parts = [slice(low, high) for low, high in pairwise(ends.tolist())]
    scale = evidence_scale(evidence)
    effects = tuple(
        Effect(c.mechanism, c.covariate, c.basis, coefficients[part], covariance[part, part], scale)
        for c, part in zip(candidates, parts, strict=True)
    )
    return effects, {(i, j): covariance[parts[i], parts[j]] for i, j in combinations(range(len(parts)), 2)}


def _least_squares(columns: Array, z: Array, block: IntArray, ridge: Array) -> tuple[Array, Array]:
    """Coefficients (p,) of columns (n, 3, p) for z (n, 3), and their jackknife covariance over blocks (n,).

    ridge (p,): added to the columns' squares.
    """
    parts = [(columns[block == b].reshape(-1, columns.shape[2]), z[block == b].ravel()) for b in np.unique(block)]
    squares = np.stack([x.T @ x for x, _ in parts])
    targets = np.stack([x.T @ y for x, y in parts])
    square = squares.sum(axis=0) + np.diag(ridge)
    coefficients = np.linalg.solve(square, targets.sum(axis=0))
    scores = targets - squares @ coefficients
    away = np.linalg.solve(square - squares, scores[:, :, None])[:, :, 0]
    return coefficients, (1.0 - 1.0 / len(parts)) * away.T @ away
