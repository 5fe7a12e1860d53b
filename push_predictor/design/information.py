# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What pushes would add to a model's knowledge, and which add most: exact updates of a Gaussian posterior.

The outcomes need not be known for them.

With features phi of an outcome and weights of covariance P, observing rows Phi with noise covariance N changes P to
P - P Phi' S^-1 Phi P, S = Phi P Phi' + N, whatever the outcomes are. The loss is what not knowing the mean function
costs in predictive density, in nats per output: the mean of 1/2 log(1 + v) over the pushes that matter, with v their
variance in units of noise. Where v is small that is the mean variance (a V optimal design, Fedorov 1972). Where v is
large only its order of magnitude counts, else the output with the least noise would decide alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from push_predictor.types import Array, IntArray
from push_predictor.watch import Watch, no_watch, watched


class Information:
    """The posterior of the weights, seen from c candidates of k outcomes each.

    features (c, k, q): of the candidates' outcomes. noise (c, k, k): their covariance given the weights; outcomes that
    a candidate does not have are rows of zero features and unit noise. matter (m, q): features of the outcomes that
    matter. All in units of noise.
    """

    def __init__(self, features: Array, noise: Array, matter: Array) -> None:
        self.features, self.noise, self.matter = features, noise, matter
        # Phi P next to Phi P matter': all that is needed of P, and both change alike.
        self._known = np.concatenate([features, features @ matter.T], axis=2)
        self._variance = np.sum(matter**2, axis=1)

    @property
    def variance(self) -> float:
        """Mean variance of what matters, in units of noise."""
        return float(np.mean(self._variance))

    @property
    def covariance(self) -> Array:
        """Covariance (c, k, k) of the mean functions of each candidate's outcomes."""
        q = self.features.shape[2]
        return np.asarray(self._known[:, :, :q] @ self.features.transpose(0, 2, 1))

    def reductions(self) -> Array:
        """By how much each candidate would reduce the variance of what matters, (c, m)."""
        shared = self._known[:, :, self.features.shape[2] :]
        return np.asarray(np.einsum("ckm,ckm->cm", shared, np.linalg.solve(self.covariance + self.noise, shared)))

    def gains(self) -> Array:
        """By how much each candidate would reduce the loss, (c,)."""
        after = np.maximum(self._variance - self.reductions(), 0.0)  # rounding may leave less
        return np.asarray(0.5 * np.mean(np.log1p(self._variance) - np.log1p(after), axis=1))

    def observe(self, chosen: int) -> None:
        """Take the outcomes of a candidate for known."""
        q, known = self.features.shape[2], self._known[chosen].copy()
        gain = np.linalg.solve(known[:, :q] @ self.features[chosen].T + self.noise[chosen], known)
        self._variance = np.maximum(self._variance - np.sum(known[:, q:] * gain[:, q:], axis=0), 0.0)
        self._known -= (self.features @ known[:, :q].T) @ gain


def greedy(
    information: Information,
    count: int,
    given: Sequence[int | None] = (),
    factor: Callable[[Sequence[int]], Array] | None = None,
    check_cancelled: Callable[[], None] | None = None,
    watch: Watch = no_watch,
) -> tuple[IntArray, Array]:
    """Candidates (count,) in the order chosen, and the mean variance (count,) of what matters after each.

    given: candidates that are taken in their place, None where one is chosen; those after its end are chosen. factor:
    by how much the gain of each candidate (c,) counts after those chosen so far, 1 without it. check_cancelled is
    called before each choice and may raise, watch with the share of the choices made.
    """
    order: list[int] = []
    variances = np.empty(count)
    for k in watched(range(count), watch, "push"):
        if check_cancelled is not None:
            check_cancelled()
        fixed = given[k] if k < len(given) else None
        order.append(_best(information.gains(), None if factor is None else factor(order)) if fixed is None else fixed)
        information.observe(order[-1])
        variances[k] = information.variance
    return np.array(order, dtype=np.int64), variances


def _best(gains: Array, factor: Array | None) -> int:
    return int(np.argmax(gains if factor is None else gains * factor))
