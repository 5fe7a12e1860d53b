# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters that walk at random from push to push, estimated push by push: an interacting multiple model filter.

How fast they walk is not known, so that there is one filter for each of some speeds. Before a push the filters are
mixed by how likely a change of speed is, after it each is weighted by how well it predicted the push (Blom and
Bar-Shalom 1988, "The interacting multiple model algorithm for systems with Markovian switching coefficients"). A filter
is an iterated extended Kalman filter. The windows of a push share their deviation, so that each counts for a part; a
push enters with the weight of Student's t, so that one bad push moves little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.models.mechanics.fit import DEGREES
from push_predictor.types import Array

SPEEDS = {
    0.0: 0.85,
    0.02: 0.14,
    0.3: 0.01,
}  # standard deviations per push, and how often: none, wear, jumps
STEADY = 0.8  # probability that the speed stays, else it is drawn again: a jump takes some five pushes
LINEARISED = 3  # times per push
CORRELATION = 0.8  # of the windows of a push: they share the friction under it and what a model misses there
LARGEST_SQUARE = 9.0  # of a residual in standard deviations: one bad window says little about the noise of others
MEMORY = 200.0  # independent windows that the noise is averaged over
REFUSED = 2.0  # posterior standard deviations beyond the plausible range from which a push is not explained

# From a change (p,) of the parameters to the shift (n, 3) of the mean, and its derivatives (n, 3, p).
Shift: TypeAlias = Callable[[Array], tuple[Array, Array]]


class Observed(NamedTuple):
    """The windows of a push: residual (n, 3) of the deployed mean, covariance (n, 3, 3).

    They share their deviation: each counts for a `share` of an independent one.
    """

    residual: Array
    covariance: Array

    @property
    def share(self) -> float:
        """1 / (1 + (n - 1) r) with a correlation r."""
        return 1.0 / (1.0 + (len(self.residual) - 1.0) * CORRELATION)


@dataclass(frozen=True, eq=False)
class Noise:
    """factor (3,) on the variances of the deployed model, as sure as from so many independent windows.

    usual_square (3,): mean square of the deployed model's residuals in its standard deviations, cut off at
    LARGEST_SQUARE.
    """

    windows: float
    usual_square: Array
    factor: Array = field(default_factory=lambda: np.ones(3))

    def after(self, square: Array, share: float) -> Noise:
        """After a push with squared residuals (n, 3) over the deployed variances; share: see Observed."""
        count = share * len(square)
        windows = min(self.windows + count, MEMORY)
        cut_off = np.minimum(square / self.factor, LARGEST_SQUARE)
        growth = (np.mean(cut_off, axis=0) / self.usual_square - 1.0) * count / windows
        return replace(self, windows=windows, factor=self.factor * (1.0 + growth))


@dataclass(frozen=True, eq=False)
class Walk:
    """What is known of a change (p,) of parameters after some pushes, for each of s speeds; usual (s,): how often.

    spread (p,): prior standard deviations, the unit of `speeds` (s,) as well. low, high (p,): of the change.
    probability (s,), means (s, p), covariances (s, p, p). refused: whether the last push would have needed implausible
    parameters.
    """

    spread: Array
    low: Array
    high: Array
    speeds: Array
    usual: Array
    probability: Array
    means: Array
    covariances: Array
    noise: Noise
    refused: bool = False

    @classmethod
    def start(
        cls, covariance: Array, low: Array, high: Array, noise: Noise, speeds: Mapping[float, float] = SPEEDS
    ) -> Walk:
        """Before the first push: no change, with this covariance (p, p)."""
        s, p = len(speeds), len(covariance)
        each, usual = np.array(list(speeds)), np.array(list(speeds.values()))
        spread = np.sqrt(np.diagonal(covariance))
        of_all = np.tile(covariance, (s, 1, 1))
        return cls(spread, low, high, each, usual, usual, np.zeros((s, p)), of_all, noise)

    @property
    def mean(self) -> Array:
        """The change, (p,)."""
        return np.asarray(self.probability @ self.means)

    @property
    def covariance(self) -> Array:
        """Of the change, (p, p)."""
        return _mixed(self.probability, self.means, self.covariances)

    def after(self, observed: Observed, shift: Shift) -> tuple[Walk, float]:
        """After a push, and the log density of its windows before they were known.

        A push that only implausible parameters would explain leaves them as they were.
        """
        before = self._before_push()
        root = np.sqrt(self.noise.factor)
        seen = observed._replace(covariance=observed.covariance * root[:, None] * root)
        likelihood, means, covariances = before._updated(seen, shift)
        probability = before.probability * np.exp(likelihood - likelihood.max())
        evidence = float(likelihood.max() + np.log(probability.sum()))
        found = replace(before, probability=probability / probability.sum(), means=means, covariances=covariances)
        mean, sd = found.mean, np.sqrt(np.diagonal(found.covariance))
        if np.any(mean < self.low - REFUSED * sd) or np.any(mean > self.high + REFUSED * sd):
            return replace(self, refused=True), evidence
        found = replace(found, means=np.clip(means, self.low, self.high), refused=False)
        return found._with_noise(observed, shift), evidence

    def _before_push(self) -> Walk:
        """The filters mixed, and their parameters moved on."""
        joint = self.probability[:, None] * (STEADY * np.eye(len(self.usual)) + (1.0 - STEADY) * self.usual)  # from, to
        probability = joint.sum(axis=0)
        share = (joint / probability).T
        walked = (self.speeds[:, None] * self.spread) ** 2
        covariances = np.stack([_mixed(own, self.means, self.covariances) for own in share])
        covariances += walked[:, :, None] * np.eye(len(self.spread))
        return replace(self, probability=probability, means=share @ self.means, covariances=covariances)

    def _updated(self, seen: Observed, shift: Shift) -> tuple[Array, Array, Array]:
        """Log density (s,) of a push under each filter, means (s, p), covariances (s, p, p) after it."""
        noise = _blocks(seen.covariance / seen.share)
        about, means, covariances, likelihood = self.mean, self.means, self.covariances, np.zeros(len(self.speeds))
        for _ in range(LINEARISED if len(self.spread) else 1):
            moved, slopes = shift(np.clip(about, self.low, self.high))
            about = np.clip(about, self.low, self.high)
            jacobian = slopes.reshape(noise.shape[0], -1)
            found = [
                _kalman(
                    mean, covariance, (seen.residual - moved).ravel() + jacobian @ (about - mean), jacobian, noise, seen
                )
                for mean, covariance in zip(self.means, self.covariances, strict=True)
            ]
            likelihood = np.array([each[0] for each in found])
            means, covariances = np.stack([each[1] for each in found]), np.stack([each[2] for each in found])
            posterior = self.probability * np.exp(likelihood - likelihood.max())
            about = posterior @ means / posterior.sum()
        return likelihood, means, covariances

    def _with_noise(self, observed: Observed, shift: Shift) -> Walk:
        """With the factor of the noise after a push, whose residuals count with the uncertainty of the parameters."""
        moved, slopes = shift(self.mean)
        unsure = np.einsum("nkp,pq,nkq->nk", slopes, self.covariance, slopes)
        variance = np.diagonal(observed.covariance, axis1=1, axis2=2)
        square = (observed.residual - moved) ** 2 + unsure
        return replace(self, noise=self.noise.after(square / variance, observed.share))


def _kalman(
    mean: Array, covariance: Array, innovation: Array, jacobian: Array, noise: Array, seen: Observed
) -> tuple[float, Array, Array]:
    """Log density of an innovation (m,), and mean (p,) and covariance (p, p) after it, with the weight of Student's t.

    The density is that of as many independent outputs as the windows are worth.
    """
    gain = covariance @ jacobian.T
    lower = np.linalg.cholesky(noise + jacobian @ gain)
    whitened = np.linalg.solve(lower, innovation)
    square, count = float(whitened @ whitened), seen.share * len(innovation)
    log_density = -np.log(np.diagonal(lower)).sum() - 0.5 * (DEGREES + count) * np.log1p(square / DEGREES)
    weight = min((DEGREES + count) / (DEGREES + square), 1.0)
    lower = np.linalg.cholesky(noise / weight + jacobian @ gain)
    half = np.linalg.solve(lower, gain.T)
    return log_density, mean + half.T @ np.linalg.solve(lower, innovation), covariance - half.T @ half


def _mixed(probability: Array, means: Array, covariances: Array) -> Array:
    """Covariance (p, p) of a mixture."""
    away = means - probability @ means
    return np.asarray(
        np.einsum("s,spq->pq", probability, covariances) + np.einsum("s,sp,sq->pq", probability, away, away)
    )


def _blocks(covariance: Array) -> Array:
    """Block-diagonal matrix (3 n, 3 n) of n covariances (n, 3, 3)."""
    n = len(covariance)
    found = np.zeros((n, 3, n, 3))
    found[np.arange(n), :, np.arange(n)] = covariance
    return found.reshape(3 * n, 3 * n)
