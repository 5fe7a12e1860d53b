# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The learnt predictor: three regressions and the correlation of their outputs, alone or about fitted mechanics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.features import DEVIATION, Scaling
from push_predictor.models.gaussian_process.prediction import LatentPrediction, exact_log_density
from push_predictor.models.gaussian_process.regression import Regression
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.predictors.correlation import Correlation, covariances
from push_predictor.models.predictors.predictor import BasePredictor, Moments, Shift
from push_predictor.models.predictors.tails import Tails
from push_predictor.models.pushes import Push
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class GaussianProcessPredictor(BasePredictor):
    """Three independent regressions on standardised features (Bauza and Rodriguez 2017, section IV).

    correlation: of the outputs given the push; None where they are independent. mean: mechanics about which the
    regressions have learnt the residuals; None where they have learnt the outcomes themselves. The scaling is that of
    what they have learnt, which is per path length of the tip unless the scaling has no travel. tails: the distribution
    of new pushes, to which the covariances are widened; None where the training pushes were too few.
    """

    rig: Rig
    scaling: Scaling
    regressions: tuple[Regression, ...]
    correlation: Correlation | None = None
    mean: FittedMechanics | None = None
    tails: Tails | None = None

    learnt = True

    @property
    def gaussian(self) -> bool:
        """Whether the exact predictive is the Gaussian of its moments: with known noise and no tails."""
        return self.tails is None and all(regression.gaussian for regression in self.regressions)

    @property
    def absorbs(self) -> bool:
        """See BasePredictor: without a mean."""
        return self.mean is None

    @cached_property
    def mechanics(self) -> FittedMechanics:
        """See BasePredictor: the mean, or the textbook's analytical model."""
        if self.mean is not None:
            return self.mean
        return analytical_mechanics(self.rig.outline, self.rig.pusher_radius)

    @cached_property
    def reported_sd(self) -> Array:
        """Reported standard deviations of what was learnt over those of the regressions, (3,), SI units."""
        sd = self.scaling.outcome_sd
        return sd if self.tails is None else np.asarray(sd * self.tails.factor)

    def moments(self, push: Push) -> Moments:
        """See BasePredictor. Every outcome takes the duration of the training windows; the caller has checked it."""
        features = self.scaling.features(self.rig.outline, push.inputs)
        latent = [regression.predict(features) for regression in self.regressions]
        return self.of_outcomes(
            self._moments_of(latent, self.correlation.at(features) if self.correlation else None), push
        )

    def held_out_moments(self, rows: Push, block: IntArray) -> Moments:
        """See BasePredictor. The correlation at a row is that of the other blocks; the mean is that of all rows."""
        latent = [regression.held_out(block) for regression in self.regressions]
        features = self.regressions[0].inputs
        correlation = self.correlation.held_out(features, block) if self.correlation else None
        return self.of_outcomes(self._moments_of(latent, correlation), rows)

    def shifted_log_density(self, push: Push, outcomes: Array, shift: Shift, scale: Array) -> Array | None:
        """See BasePredictor.

        With tails, the t distribution is shifted and widened. Without, the latent function is shifted and less certain,
        and its noise is scaled.
        """
        if self.tails is not None:
            moments = self.moments(push)
            variance = _variances(moments.covariance) * scale**2 + _variances(shift.covariance)
            return _student(self.tails, outcomes - moments.mean - shift.mean, variance)
        if self.gaussian:
            return None
        sd = self._units(push)
        mean, variance = shift.mean / sd, np.diagonal(shift.covariance, axis1=1, axis2=2) / sd**2
        latent = [
            replace(
                p,
                mean=p.mean + mean[:, k],
                variance=p.variance * scale[k] ** 2 + variance[:, k],
                log_noise_mean=p.log_noise_mean + 2.0 * np.log(scale[k]),
            )
            for k, p in enumerate(self.latent(push.inputs))
        ]
        return self._log_density(latent, push, outcomes)

    def latent(self, inputs: Array) -> list[LatentPrediction]:
        """Per output, the latent predictions in standardised units; beyond the training's speeds see features.py."""
        features, beyond = self.scaling.features(self.rig.outline, inputs), self.scaling.beyond(inputs)
        found = [regression.predict(features) for regression in self.regressions]
        more, growth = (DEVIATION * beyond) ** 2, self.scaling.noise_growth(inputs)
        return [replace(p, variance=p.variance + more, log_noise_mean=p.log_noise_mean + growth) for p in found]

    def standardised(self, push: Push, outcomes: Array) -> Array:
        """Outcomes (n, 3) in the units of `latent`."""
        return self.scaling.outcomes((outcomes - self.displacement(push)) / self._size(push))

    def of_outcomes(self, learnt: Moments, push: Push) -> Moments:
        """Moments of the outcomes from those of what was learnt, which know the training's speeds alone."""
        mean, covariance, process = learnt
        if self.scaling.travel is not None:
            size, beyond = self._size(push), self.scaling.beyond(push.inputs)[:, None]
            if beyond.any():
                process = process * np.exp(self.scaling.noise_growth(push.inputs))[:, None, None]
                deviation = (DEVIATION * beyond * self.reported_sd) ** 2
                covariance = covariance - learnt.process_covariance + process + deviation[:, :, None] * np.eye(3)
            square = (size * size)[:, :, None]
            mean, covariance, process = mean * size, covariance * square, process * square
        return Moments(mean if self.mean is None else mean + self.displacement(push), covariance, process)

    def displacement(self, push: Push) -> Array:
        """Displacement (n, 3) of the mean, zero if it has none."""
        if self.mean is None:
            return np.zeros((len(push.inputs), 3))
        return self.mean.displacement(push.inputs, push.duration, push.covariates)

    def of_targets(self) -> GaussianProcessPredictor:
        """The predictor of what was learnt, at a path of the scaling's travel; itself if that are the outcomes."""
        if self.mean is None and self.scaling.travel is None:
            return self
        return replace(self, mean=None, scaling=replace(self.scaling, travel=None))

    def free_matrices(self) -> None:
        """Free what predictions would compute again."""
        for regression in self.regressions:
            if isinstance(regression, VHGP):
                regression.free_matrices()

    def with_independent_outputs(self) -> GaussianProcessPredictor:
        """See BasePredictor."""
        return replace(self, correlation=None)

    def _size(self, push: Push) -> Array:
        """Factor (n, 1) on what was learnt."""
        return self.scaling.size(push.inputs, push.duration)[:, None]

    def _units(self, push: Push) -> Array:
        """Standard deviations (n, 3) of what was learnt, in units of the outcomes."""
        return np.asarray(self._size(push) * self.scaling.outcome_sd)

    def _moments_of(self, latent: Sequence[LatentPrediction], correlation: Array | None) -> Moments:
        """Moments in SI units from latent predictions in standardised ones and correlation matrices (n, 3, 3)."""
        found = np.array([[p.mean, p.variance, p.log_noise_mean, p.log_noise_variance] for p in latent])
        joined, factor = LatentPrediction(*found.transpose(1, 2, 0)), self.reported_sd**2
        mean = joined.mean * self.scaling.outcome_sd + self.scaling.outcome_mean
        return Moments(mean, *covariances(joined.variance * factor, joined.process_variance * factor, correlation))

    def _log_density(self, latent: Sequence[LatentPrediction], push: Push, outcomes: Array) -> Array:
        """Log density (n, 3) of outcomes (n, 3) under latent predictions in standardised units, one per output."""
        scaled = self.standardised(push, outcomes)
        columns = [exact_log_density(p, scaled[:, k]) for k, p in enumerate(latent)]
        return np.column_stack(columns) - np.log(self._units(push))


def _variances(covariance: Array) -> Array:
    return np.asarray(np.diagonal(covariance, axis1=1, axis2=2))


def _student(tails: Tails, residuals: Array, variance: Array) -> Array:
    """Log density (n, 3) of residuals (n, 3) with reported variances (n, 3)."""
    sd = np.sqrt(variance)
    return np.asarray(tails.log_density(residuals / sd) - np.log(sd))
