# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predicted outcomes of pushes: mean, covariance, and whether the training data support them."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np

from push_predictor.models.predictors.tails import IntervalKind, Tails, half_widths
from push_predictor.types import Array, BoolArray

ROWS_SHOWN = 10
NOT_FINITE = "the velocity or a covariate is too far from the training data, or the tip wedges into a notch"


@dataclass(frozen=True, eq=False, repr=False)
class Prediction:
    """n predicted outcomes in the push frame (dx m, dy m, dtheta rad).

    mean (n, 3); covariance (n, 3, 3) of an observed outcome; process_covariance (n, 3, 3), the noise alone;
    in_domain (n,), whether the push, with the covariates that the model needs, lies inside the domain of the training
    data; tails: the distribution in units of `std`, None for a Gaussian.
    """

    mean: Array
    covariance: Array
    process_covariance: Array
    in_domain: BoolArray
    tails: Tails | None = None

    def __len__(self) -> int:
        return len(self.mean)

    @property
    def std(self) -> Array:
        """Standard deviations (n, 3) of an observed outcome: m, m, rad."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)))

    @property
    def first_not_finite(self) -> int | None:
        """The first push without a finite mean and covariance, None if there is none."""
        if isfinite(np.vdot(self.mean, self.mean) + np.vdot(self.covariance, self.covariance)):
            return None  # a sum is finite only if all of its terms are
        finite = np.isfinite(self.mean).all(axis=1) & np.isfinite(self.covariance).all(axis=(1, 2))
        return None if finite.all() else int(np.argmin(finite))

    def interval(self, level: float = 0.95, kind: IntervalKind = "student") -> tuple[Array, Array]:
        """Low and high ends (n, 3) of the central intervals that contain a new outcome with this probability.

        kind: student, by the predicted distribution; conformal, by the quantiles of the residuals of held-out training
        pushes. Raises RequestError for a level outside (0, 1) or too near 1 for the number of training pushes, and for
        conformal intervals of a model that has none.
        """
        half = half_widths(self.tails, level, kind) * self.std
        return self.mean - half, self.mean + half

    def __repr__(self) -> str:
        head = f"Prediction of {len(self)} {'push' if len(self) == 1 else 'pushes'}, mean ± standard deviation"
        columns = f"{'dx [mm]':>18}{'dy [mm]':>18}{'dtheta [mrad]':>18}  in domain"
        rows = zip(self.mean[:ROWS_SHOWN], self.std[:ROWS_SHOWN], self.in_domain[:ROWS_SHOWN], strict=True)
        lines = [f"{_cells(mean, std)}  {'yes' if inside else 'NO'}" for mean, std, inside in rows]
        more = [f"... and {len(self) - ROWS_SHOWN} more"] if len(self) > ROWS_SHOWN else []
        return "\n".join([head, columns, *lines, *more])


def _cells(mean: Array, std: Array) -> str:
    return "".join(f"{f'{1e3 * m:.3f} ± {1e3 * s:.3f}':>18}" for m, s in zip(mean, std, strict=True))
