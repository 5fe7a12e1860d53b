# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Heavy tails and the size of the error of a new push, learnt from the residuals of held-out training pushes.

Windows of one push share an error, which differs from push to push: the residuals of new pushes have heavier tails than
those of the model's own rows. So each output is predicted by a Student t distribution about the model's mean,

    (y - mean) / sd = scale T,    T ~ t(degrees),

with sd as the regressions predict it. Scale and degrees of freedom have the largest likelihood of the residuals of
pushes, each predicted without its windows, under a weak prior of the degrees. Two things would make the intervals of
few pushes too narrow. Windows of one push resemble each other, so n windows of k pushes count for

    effective = n / (1 + RESEMBLANCE (n / k - 1))                    (the design effect, Kish 1965)

windows. And the hyperparameters were fitted to the residuals' own rows, so that the variance of new pushes is larger by

    (effective + hyperparameters) / (effective - hyperparameters)     (the final prediction error, Akaike 1970).

The covariance that a model reports is that of this distribution. All methods take
and give residuals in units of the reported standard deviation, which is what callers know.

The conformal interval makes no assumption on the distribution: it takes the quantile of the absolute residuals by push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy

from push_predictor.errors import RequestError
from push_predictor.types import Array, IntArray

IntervalKind = Literal["student", "conformal"]
INTERVAL_KINDS: tuple[IntervalKind, ...] = ("student", "conformal")
STEPS = 200  # number of quantiles that are kept for each output


@dataclass(frozen=True, eq=False)
class Tails:
    """The predictive distribution of a new push, in units of the model's standard deviations.

    scale (3,), degrees (3,) > 2: of the t distribution of each output, in units of the regression's sd. joint_scale,
    joint_degrees > 2: of the t distribution of the three outputs, in units of the reported covariance's root. pushes:
    number of training pushes. quantiles (STEPS, 3): of the absolute residuals of these pushes, in units of the reported
    sd; row i is the smallest value that at least the share (i + 1) / STEPS does not exceed, where every push counts the
    same.
    """

    scale: Array
    degrees: Array
    joint_scale: float
    joint_degrees: float
    pushes: int
    quantiles: Array

    @cached_property
    def factor(self) -> Array:
        """Reported standard deviations over those of the regressions, (3,)."""
        return np.asarray(self.scale * np.sqrt(self.degrees / (self.degrees - 2.0)))

    @cached_property
    def unit_scale(self) -> Array:
        """Scale (3,) of a t distribution with a standard deviation of 1."""
        return np.asarray(np.sqrt((self.degrees - 2.0) / self.degrees))

    def log_density(self, residuals: Array) -> Array:
        """Log density (n, 3) of residuals (n, 3)."""
        return student_log_density(residuals, self.unit_scale, self.degrees)

    def probability(self, residuals: Array) -> Array:
        """Predicted probability (n, 3) of a residual below these (n, 3)."""
        return np.asarray(scipy.special.stdtr(self.degrees, residuals / self.unit_scale))

    def half_width(self, level: float, kind: IntervalKind = "student") -> Array:
        """Half-width (3,) of the central interval of that level, in (0, 1). Raises RequestError."""
        _check_level(level)
        if kind == "student":
            return np.asarray(self.unit_scale * scipy.special.stdtrit(self.degrees, 0.5 + 0.5 * level))
        if kind == "conformal":
            return self._conformal(level)
        raise RequestError("interval", kind, " or ".join(INTERVAL_KINDS))

    def joint_radius(self, level: float, outputs: int = 3) -> float:
        """Mahalanobis distance, under the reported covariance, within which the outcome lies with that probability.

        outputs: how many are looked at together. For a t distribution, the squared distance over their number is
        F-distributed (Kotz and Nadarajah 2004, section 1.4).
        """
        return self.joint_scale * float(np.sqrt(outputs * scipy.special.fdtri(outputs, self.joint_degrees, level)))

    def _conformal(self, level: float) -> Array:
        """The quantile at which the training pushes and a new one, of infinite residual, reach the level.

        With k training pushes and a new push that is exchangeable with them, a random window of the new push has a
        residual below it with at least that probability (Lee, Barber and Willett 2023, "Distribution-free inference
        with hierarchical data", arXiv 2306.06342; also Dunn, Wasserman and Ramdas 2022).
        """
        share = level * (self.pushes + 1) / self.pushes
        if share > 1.0:
            most = self.pushes / (self.pushes + 1.0)
            raise RequestError(
                "level", level, f"at most {most:.3g} for conformal intervals from {self.pushes} training pushes"
            )
        return np.asarray(self.quantiles[int(np.ceil(share * STEPS - 1e-9)) - 1])


def half_widths(tails: Tails | None, level: float, kind: IntervalKind = "student") -> Array:
    """Half-width (3,) of central intervals in predicted standard deviations; those of a Gaussian without tails.

    Raises RequestError for a level outside (0, 1), and for conformal intervals that the model does not have.
    """
    if tails is not None:
        return tails.half_width(level, kind)
    if kind != "student":
        raise RequestError("interval", kind, "student, for a model without residuals of held-out training pushes")
    _check_level(level)
    return np.full(3, float(scipy.special.ndtri(0.5 + 0.5 * level)))


def joint_radius(tails: Tails | None, level: float, outputs: int = 3) -> float:
    """See Tails; that of a Gaussian without tails."""
    if tails is not None:
        return tails.joint_radius(level, outputs)
    return float(np.sqrt(scipy.special.chdtri(outputs, 1.0 - level)))


def _check_level(level: float) -> None:
    if not 0.0 < level < 1.0:
        raise RequestError("level", level, "a number above 0 and below 1")


def student_log_density(residuals: Array, scale: Array | float, degrees: Array | float) -> Array:
    """Log density of residuals (...) under t distributions about zero with scale and degrees of freedom."""
    constant = (
        scipy.special.gammaln(0.5 * (degrees + 1.0))
        - scipy.special.gammaln(0.5 * degrees)
        - 0.5 * np.log(np.pi * degrees)
    )
    square = (residuals / scale) ** 2
    return np.asarray(constant - np.log(scale) - 0.5 * (degrees + 1.0) * np.log1p(square / degrees))


FEWEST_PUSHES = 3
RESEMBLANCE = 0.45  # correlation of windows of a push, as is typical (planning/persistence.py)
USUAL_EXCESS, EXCESS_SD = 2.0, 0.5  # prior of the degrees: log-normal of what they are above 2
LEAST_FREE = 0.5  # of the effective windows that stay, however many hyperparameters there are


def fit_tails(
    residuals: Array, covariance: Array, push_ids: np.ndarray, hyperparameters: Sequence[int]
) -> Tails | None:
    """The tails of residuals (n, 3) with predicted covariance (n, 3, 3), each row predicted without its push.

    push_ids (n,): the push of each row. hyperparameters: how many were fitted for each output. None for fewer than
    FEWEST_PUSHES pushes, or where a residual does not vary.
    """
    pushes, push = np.unique(push_ids, return_inverse=True)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    if len(pushes) < FEWEST_PUSHES or not np.all(np.any(residuals != 0.0, axis=0)):
        return None
    effective = len(push) / (1.0 + RESEMBLANCE * (len(push) / len(pushes) - 1.0))
    optimism = _optimism(effective, np.asarray(hyperparameters, dtype=np.float64))
    z = residuals / sd * optimism  # as those of new pushes
    scale, degrees = np.array([_likeliest(column[:, None], effective) for column in z.T]).T
    factor = scale * np.sqrt(degrees / (degrees - 2.0))
    joint_scale, joint_degrees = _likeliest(_whitened(z / factor, covariance, sd), effective)
    return Tails(scale, degrees, joint_scale, joint_degrees, len(pushes), _quantiles(np.abs(z / factor), push))


def _optimism(effective: float, hyperparameters: Array) -> Array:
    """Standard deviation of new residuals over that of residuals of rows that the hyperparameters have seen, (3,)."""
    left = np.maximum(effective - hyperparameters, LEAST_FREE * effective)
    return np.asarray(np.sqrt((effective + hyperparameters) / left))


def _likeliest(z: Array, effective: float) -> tuple[float, float]:
    """Scale and degrees of freedom of residuals (n, k) in k dimensions."""
    from scipy.optimize import minimize  # its import would take every node 0.2 s at the start

    distance, size = np.linalg.norm(z, axis=1), z.shape[1]
    start = np.array([0.5 * np.log(np.mean(distance**2) / size), np.log(USUAL_EXCESS)])

    def cost(vector: Array) -> float:
        scale, degrees = float(np.exp(vector[0])), 2.0 + float(np.exp(vector[1]))
        prior = 0.5 * ((vector[1] - start[1]) / EXCESS_SD) ** 2
        return float(prior - effective * np.mean(_radial_log_density(distance, size, scale, degrees)))

    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-6}).x
    return float(np.exp(found[0])), 2.0 + float(np.exp(found[1]))


def _radial_log_density(distance: Array, size: int, scale: float, degrees: float) -> Array:
    """Log density (n,) of a t distribution in `size` dimensions at distances (n,), up to a constant of `size`."""
    if size == 1:
        return student_log_density(distance, scale, degrees)
    constant = (
        scipy.special.gammaln(0.5 * (degrees + size))
        - scipy.special.gammaln(0.5 * degrees)
        - 0.5 * size * np.log(degrees)
    )
    reach = np.log1p((distance / scale) ** 2 / degrees)
    return np.asarray(constant - size * np.log(scale) - 0.5 * (degrees + size) * reach)


def _whitened(z: Array, covariance: Array, sd: Array) -> Array:
    """Standardised residuals (n, 3), whitened by the predicted correlation."""
    lower = np.linalg.cholesky(covariance / (sd[:, :, None] * sd[:, None, :]))
    return np.asarray(np.linalg.solve(lower, z[:, :, None])[:, :, 0])


def _quantiles(away: Array, push: IntArray) -> Array:
    """Quantiles (STEPS, 3) of residuals (n, 3) where every push counts the same; see Tails."""
    weight = 1.0 / np.bincount(push)[push] / (int(push.max()) + 1)
    wanted = np.arange(1, STEPS + 1) / STEPS
    columns = []
    for column in away.T:
        order = np.argsort(column)
        reached = np.cumsum(weight[order])
        place = np.searchsorted(reached, wanted - 1e-9)
        columns.append(column[order][np.minimum(place, len(order) - 1)])
    return np.column_stack(columns)
