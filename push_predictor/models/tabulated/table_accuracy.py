"""How far a table's covariances are from those of a model."""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array


def relative_error(found: Array, exact: Array) -> Array:
    """Largest relative error (n,) of covariances (n, 3, 3) in the variance of any combination of outputs."""
    whitener = np.linalg.inv(np.linalg.cholesky(exact))
    eigenvalues = np.linalg.eigvalsh(whitener @ found @ whitener.transpose(0, 2, 1))
    return np.asarray(np.abs(eigenvalues - 1.0).max(axis=1))
