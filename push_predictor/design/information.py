"""What pushes would tell: exact updates of a Gaussian posterior by outcomes that need not be known.

With features phi of an outcome and weights of covariance P, observing rows Phi with noise covariance N changes P to
P - P Phi' S^-1 Phi P, S = Phi P Phi' + N, whatever the outcomes are. The loss is the variance over the pushes that
matter, tr(U' P U) with U the root of their mean square, U U' = mean of phi' phi, so that a push reduces it by
tr(S^-1 Phi P U U' P Phi'): a design that is optimal on average over a region (V or I optimal; Fedorov 1972).
"""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array


class Information:
    """The posterior of the weights, seen from c candidates of k outcomes each.

    features (c, k, q): of the candidates' outcomes. noise (c, k, k): their covariance given the weights; outcomes that
    a candidate does not have are rows of zero features and unit noise. matter (m, q): features of the outcomes that
    matter.
    """

    def __init__(self, features: Array, noise: Array, matter: Array) -> None:
        self.features, self.noise = features, noise
        values, vectors = np.linalg.eigh(matter.T @ matter / len(matter))
        self.root = vectors * np.sqrt(np.maximum(values, 0.0))
        # Phi P next to Phi P U: all that is needed of P, and both change alike.
        self._known = np.concatenate([features, features @ self.root], axis=2)
        self.loss = float(np.sum(self.root**2))

    @property
    def covariance(self) -> Array:
        """Covariance (c, k, k) of the mean functions of each candidate's outcomes."""
        q = self.features.shape[2]
        return np.asarray(self._known[:, :, :q] @ self.features.transpose(0, 2, 1))

    def gains(self) -> Array:
        """By how much each candidate would reduce the loss, (c,)."""
        of_loss = self._known[:, :, self.features.shape[2] :]
        return np.asarray(np.einsum("cks,cks->c", of_loss, np.linalg.solve(self.covariance + self.noise, of_loss)))

    def observe(self, chosen: int) -> float:
        """Take the outcomes of a candidate for known; returns by how much that reduces the loss."""
        q, known = self.features.shape[2], self._known[chosen].copy()
        gain = np.linalg.solve(known[:, :q] @ self.features[chosen].T + self.noise[chosen], known)
        reduction = float(np.sum(known[:, q:] * gain[:, q:]))
        self._known -= (self.features @ known[:, :q].T) @ gain
        self.loss -= reduction
        return reduction
