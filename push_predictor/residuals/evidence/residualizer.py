# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Regress control variables out of residuals and candidates alike (Frisch and Waugh 1933)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.gaussian_process.ridge import rows_of_blocks
from push_predictor.types import Array, IntArray

SINGULAR = 0.01  # bounds the adjustment of a block that alone determines a direction of the controls


class Residualizer:
    """Least-squares projection off control variables (n, m)."""

    def __init__(self, controls: Array) -> None:
        left, values, _ = np.linalg.svd(controls, full_matrices=False)
        self.q: Array = left[:, values > 1e-9 * max(values[0], np.finfo(float).tiny)] if controls.shape[1] else controls

    def __call__(self, values: Array) -> Array:
        """Values (n, ...) minus their fit by the controls."""
        flat = values.reshape(len(values), -1)
        return np.asarray(flat - self.q @ (self.q.T @ flat)).reshape(values.shape)

    def blocks(self, z: Array, block: IntArray, noise: Array | None = None) -> ResidualBlocks:
        """Residuals z (n, 3) minus their fit, with the small-sample adjustment of every block (n,).

        noise (n, 3): what is adjusted in place of the residuals.
        """
        residual = self(z)
        adjusted = residual.copy() if noise is None else self(noise)
        if self.q.shape[1]:
            for rows in rows_of_blocks(block):
                own = self.q[rows]  # (b, k, m)
                values, vectors = np.linalg.eigh(np.eye(rows.shape[1]) - own @ own.transpose(0, 2, 1))
                scaled = vectors / np.sqrt(np.maximum(values, SINGULAR))[:, None, :]
                adjusted[rows] = scaled @ (vectors.transpose(0, 2, 1) @ adjusted[rows])
        return ResidualBlocks(residual, adjusted, block)


@dataclass(frozen=True, eq=False)
class ResidualBlocks:
    """Residuals (n, 3) after regression, and the same adjusted for the regression's degrees of freedom.

    A fit shrinks residuals, and chance would look rarer than it is. The adjustment multiplies a block's rows by
    (1 - H)^-1/2, H the hat matrix (Bell and McCaffrey 2002). block (n,): block of pushes of every row.
    """

    residual: Array
    adjusted: Array
    block: IntArray

    def orthogonal_to(self, columns: Array | None) -> ResidualBlocks:
        """Project off orthonormal columns (3 n, q), all outputs together, and adjust for these too."""
        if columns is None:
            return self
        parts = [flat - columns @ (columns.T @ flat) for flat in (self.residual.ravel(), self.adjusted.ravel())]
        residual, adjusted = (part.reshape(self.residual.shape) for part in parts)
        rows_of = columns.reshape(*self.residual.shape, -1)
        for rows in rows_of_blocks(self.block):
            there = rows_of[rows].reshape(len(rows), -1, columns.shape[1])
            adjusted[rows] = _unshrunk(there, adjusted[rows].reshape(len(rows), -1)).reshape(*rows.shape, -1)
        return ResidualBlocks(residual, adjusted, self.block)


def _unshrunk(columns: Array, values: Array) -> Array:
    """(1 - H)^-1/2 times values (b, k), H the part of the hat matrix in a block.

    columns (b, k, q): those of each of b blocks, orthonormal over all.
    """
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    factor = 1.0 / np.sqrt(np.maximum(1.0 - size**2, SINGULAR)) - 1.0
    inside = left.transpose(0, 2, 1) @ values[:, :, None]
    return np.asarray(values + (left @ (factor[:, :, None] * inside))[:, :, 0])


def sums_by(block: IntArray, values: Array) -> Array:
    """Sums (b, p) of values (n, p) over the blocks, in ascending order of their numbers."""
    order = np.argsort(block, kind="stable")
    starts = np.unique(block[order], return_index=True)[1]
    return np.asarray(np.add.reduceat(values[order], starts))
