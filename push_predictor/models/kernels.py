"""The automatic-relevance squared exponential kernel, its values and its derivatives.

    k(x, x') = s^2 exp(-1/2 sum_d ((x_d - x'_d) / l_d)^2)

Both hyperparameters are kept as logarithms. A derivative is never formed as a matrix: `gradient` contracts
a weight matrix with all of them at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array


@dataclass(frozen=True)
class SquaredExponential:
    """ARD squared exponential; log_lengthscales (D,), log_sd the log of the standard deviation s."""

    log_lengthscales: Array
    log_sd: float

    @property
    def variance(self) -> float:
        """k(x, x), the same for every x."""
        return float(np.exp(2.0 * self.log_sd))

    def matrix(self, inputs: Array) -> Array:
        """Kernel between all rows of inputs (n, D), shape (n, n), exactly symmetric."""
        return self.cross(inputs, inputs)

    def cross(self, left: Array, right: Array) -> Array:
        """Kernel between the rows of left (n, D) and right (m, D), shape (n, m)."""
        a, b = self._scaled(left), self._scaled(right)
        if len(a) == 1:
            exponent = -0.5 * ((a - b) ** 2).sum(axis=1)[None, :]
        else:
            # One matrix of (n, m) is all the memory used. Rounding may leave a tiny positive exponent at r = 0.
            exponent = a @ b.T
            exponent -= 0.5 * (a * a).sum(axis=1)[:, None] + 0.5 * (b * b).sum(axis=1)
            np.minimum(exponent, 0.0, out=exponent)
        exponent += 2.0 * self.log_sd
        np.exp(exponent, out=exponent)
        return np.asarray(exponent)

    def gradient(self, inputs: Array, matrix: Array, weights: Array) -> Array:
        """sum_ij weights_ij d matrix_ij / d(log_lengthscales, log_sd), shape (D + 1,).

        inputs (n, D); matrix is `self.matrix(inputs)`; weights (n, n) symmetric.
        """
        z = self._scaled(inputs)
        contracted = weights * matrix
        rows = contracted.sum(axis=1)
        # sum_ij G_ij (z_i - z_j)^2 = 2 (rows' z^2 - z' G z) for a symmetric G
        lengthscales = 2.0 * (rows @ (z * z) - (z * (contracted @ z)).sum(axis=0))
        return np.append(lengthscales, 2.0 * rows.sum())

    def _scaled(self, inputs: Array) -> Array:
        return inputs * np.exp(-self.log_lengthscales)
