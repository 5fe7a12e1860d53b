# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The prediction of a window of a push under way, given what its earlier windows have shown.

What persists within a push (persistence.py) makes the residuals of its windows correlated. With z the whitened
residuals of the earlier windows, C their correlation and c their correlation with the new window, output by output,

    mean = predicted mean + root (c' C^-1 z),    covariance = root (1 - c' C^-1 c) root'

where root root' is the predicted covariance. The same correlation joins the windows of a rollout.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.models.prediction import Prediction
from push_predictor.planning.persistence import Persistence, root_of
from push_predictor.types import Array

LARGEST = 3.0  # whitened residual of an earlier window: tails are heavy, and outliers do not persist


@dataclass(frozen=True, eq=False)
class EarlierWindows:
    """Observed windows of a push under way.

    predictions: of the k windows; observed (k, 3): their outcomes, m, m, rad; distance (k,): from the start of each to
    the start of the predicted window along the tip's path, m, above zero.
    """

    predictions: Prediction
    observed: Array
    distance: Array

    def __post_init__(self) -> None:
        k = len(self.predictions)
        for name, shape in (("observed", (k, 3)), ("distance", (k,))):
            values = getattr(self, name)
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise RequestError(name, values.tolist(), f"finite numbers of shape {shape}, one row an earlier window")
        if np.any(self.distance <= 0.0):
            raise RequestError("distance", self.distance.tolist(), "lengths above 0 m")

    @property
    def whitened(self) -> Array:
        """Residuals (k, 3) whitened by the predicted covariance, none longer than LARGEST in an output."""
        root = np.linalg.pinv(root_of(self.predictions.covariance))
        z = (root @ (self.observed - self.predictions.mean)[:, :, None])[:, :, 0]
        return np.asarray(np.clip(z, -LARGEST, LARGEST))


def given_earlier(prediction: Prediction, earlier: EarlierWindows, persistence: Persistence) -> Prediction:
    """Predictions of n alternatives for the next window of a push, given its earlier windows.

    The process covariance becomes smaller by the same share. Without earlier windows, the prediction itself.
    """
    if not len(earlier.distance):
        return prediction
    shift, share = _conditioned(earlier, persistence)
    root = root_of(prediction.covariance)
    smaller = root * np.sqrt(share)
    covariance = smaller @ np.swapaxes(smaller, 1, 2)
    of_process = root_of(prediction.process_covariance) * np.sqrt(share)
    return replace(
        prediction,
        mean=prediction.mean + root @ shift,
        covariance=covariance,
        process_covariance=of_process @ np.swapaxes(of_process, 1, 2),
    )


def _conditioned(earlier: EarlierWindows, persistence: Persistence) -> tuple[Array, Array]:
    """Expected whitened residual (3,) of the next window, and the share (3,) of its variance that is left."""
    apart = np.abs(earlier.distance[:, None] - earlier.distance[None, :])
    k = len(apart)
    among = persistence.correlation(apart.ravel()).reshape(k, k, 3)
    among[np.arange(k), np.arange(k)] = 1.0
    with_next = persistence.correlation(earlier.distance)
    weights = np.column_stack([np.linalg.solve(among[:, :, j], with_next[:, j]) for j in range(3)])
    shift = np.sum(weights * earlier.whitened, axis=0)
    return shift, np.asarray(np.maximum(1.0 - np.sum(weights * with_next, axis=0), 0.0))
