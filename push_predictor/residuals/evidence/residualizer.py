"""Regress a basis out of residuals and candidates alike (Frisch and Waugh 1933)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array, IntArray

SINGULAR = 0.01  # a block that alone fixes a direction of the inputs is enlarged no more than so


class Residualizer:
    """Takes a basis (n, m) out of values, by least squares."""

    def __init__(self, basis: Array) -> None:
        left, values, _ = np.linalg.svd(basis, full_matrices=False)
        self.q: Array = left[:, values > 1e-9 * max(values[0], np.finfo(float).tiny)] if basis.shape[1] else basis

    def __call__(self, values: Array) -> Array:
        """Values (n, ...) less their fit."""
        flat = values.reshape(len(values), -1)
        return np.asarray(flat - self.q @ (self.q.T @ flat)).reshape(values.shape)

    def left(self, z: Array, block: IntArray) -> ResidualBlocks:
        """Residuals z (n, 3) without the basis."""
        left = self(z)
        enlarged = left.copy()
        if self.q.shape[1]:
            for rows in _rows_of(block):
                values, vectors = np.linalg.eigh(np.eye(len(rows)) - self.q[rows] @ self.q[rows].T)
                enlarged[rows] = (vectors / np.sqrt(np.maximum(values, SINGULAR))) @ (vectors.T @ left[rows])
        return ResidualBlocks(left, enlarged, block)


def _rows_of(block: IntArray) -> list[IntArray]:
    order = np.argsort(block, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(block[order])) + 1)


@dataclass(frozen=True, eq=False)
class ResidualBlocks:
    """Residuals without the inputs: left (n, 3), and as large as before a fit made them smaller, enlarged (n, 3)."""

    left: Array
    enlarged: Array
    block: IntArray

    def apart(self, beside: Array | None) -> ResidualBlocks:
        """Less what orthonormal columns (3 n, q) explain of them, all outputs together."""
        if beside is None:
            return self
        parts = [flat - beside @ (beside.T @ flat) for flat in (self.left.ravel(), self.enlarged.ravel())]
        return ResidualBlocks(parts[0].reshape(self.left.shape), parts[1].reshape(self.left.shape), self.block)


def sums_by(block: IntArray, values: Array) -> Array:
    """Sums (b, p) of values (n, p) over the blocks, in ascending order of their numbers."""
    numbers, index = np.unique(block, return_inverse=True)
    sums = np.zeros((len(numbers), values.shape[1]))
    np.add.at(sums, index, values)
    return sums
