# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The learnt predictor: three regressions and the correlation of their outputs, alone or about fitted mechanics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.gaussian_process.constant import ConstantNoise
from push_predictor.models.gaussian_process.kernels import DEFAULT_CHOICE, KernelChoice
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.quadrature import exact_log_density
from push_predictor.models.gaussian_process.regression import Regression
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.predictors.correlation import Correlation, covariances
from push_predictor.models.predictors.mechanics_mean import MechanicsMean
from push_predictor.models.predictors.predictor import Moments, Shift
from push_predictor.models.predictors.scaling import Scaling
from push_predictor.models.predictors.tails import Tails
from push_predictor.models.predictors.without_effects import WithoutEffects
from push_predictor.models.push import Push
from push_predictor.recordings.rig import Rig
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class GaussianProcessPredictor(WithoutEffects):
    """Three independent regressions on standardised features (Bauza and Rodriguez 2017, section IV).

    correlation: of the outputs given the push; None where they are independent. mean: mechanics about which the
    regressions have learnt the residuals; None where they have learnt the outcomes themselves. The scaling is that of
    what they have learnt. tails: the distribution of new pushes, to which the covariances are widened; None where the
    training pushes were too few.
    """

    rig: Rig
    scaling: Scaling
    regressions: tuple[Regression, ...]
    correlation: Correlation | None = None
    mean: MechanicsMean | None = None
    tails: Tails | None = None

    @property
    def learnt(self) -> bool:
        """See Predictor."""
        return True

    @property
    def gaussian(self) -> bool:
        """See BasePredictor: with known noise and no tails."""
        return self.tails is None and all(regression.gaussian for regression in self.regressions)

    @property
    def absorbs(self) -> bool:
        """See Predictor: without a mean."""
        return self.mean is None

    @property
    def integrates(self) -> bool:
        """See Predictor."""
        return self.mean is not None

    @cached_property
    def mechanics(self) -> FittedMechanics:
        """See Predictor: the mean, or the textbook's analytical model."""
        if self.mean is not None:
            return self.mean.fitted
        return analytical_mechanics(self.rig.outline, self.rig.pusher_radius)

    @property
    def needs(self) -> tuple[str, ...]:
        """See Predictor: those of the mean."""
        return self.mean.fitted.needs if self.mean is not None else ()

    @property
    def covariates(self) -> tuple[str, ...]:
        """See Predictor: those that the mean depends on."""
        return self.needs

    @property
    def kernels(self) -> KernelChoice:
        """The kernels of its regressions; the default where all have constant noise."""
        learnt = [r.parameters.choice for r in self.regressions if not isinstance(r, ConstantNoise)]
        return learnt[0] if learnt else DEFAULT_CHOICE

    @cached_property
    def reported_sd(self) -> Array:
        """Reported standard deviations of what was learnt over those of the regressions, (3,), SI units."""
        sd = self.scaling.outcome_sd
        return sd if self.tails is None else np.asarray(sd * self.tails.factor)

    @property
    def targets(self) -> Array:
        """What the regressions were trained on (n, 3), SI: outcomes, or residuals about the mean."""
        scaled = np.column_stack([regression.outputs for regression in self.regressions])
        return np.asarray(scaled * self.scaling.outcome_sd + self.scaling.outcome_mean)

    def moments(self, push: Push) -> Moments:
        """See Predictor. Every outcome takes the duration of the training windows; the caller has checked it."""
        features = self.scaling.features(self.rig.outline, push.inputs)
        latent = [regression.predict(features) for regression in self.regressions]
        return self.about_mean(
            self._moments_of(latent, self.correlation.at(features) if self.correlation else None), push
        )

    def held_out_moments(self, rows: Push, block: IntArray) -> Moments:
        """See Predictor. The correlation at a row is that of the other blocks' rows; the mean is that of all rows."""
        latent = [regression.held_out(block) for regression in self.regressions]
        features = self.regressions[0].inputs
        correlation = self.correlation.held_out(features, block) if self.correlation else None
        return self.about_mean(self._moments_of(latent, correlation), rows)

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """See Predictor."""
        if self.tails is not None:
            moments = self.moments(push)
            return _student(self.tails, outcomes - moments.mean, _variances(moments.covariance))
        return None if self.gaussian else self._log_density(self.latent(push.inputs), push, outcomes)

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
        """Per output, the latent predictions in standardised units."""
        features = self.scaling.features(self.rig.outline, inputs)
        return [regression.predict(features) for regression in self.regressions]

    def standardised(self, push: Push, outcomes: Array) -> Array:
        """Outcomes (n, 3) in the units of `latent`."""
        return self.scaling.outcomes(outcomes if self.mean is None else self.mean.residuals(push, outcomes))

    def about_mean(self, residuals: Moments, push: Push) -> Moments:
        """Moments of the outcomes from those of what was learnt."""
        return residuals if self.mean is None else self.mean.outcomes(push, residuals)

    def without_mean(self) -> GaussianProcessPredictor:
        """The predictor of the residuals alone; itself if it has no mean."""
        return self if self.mean is None else replace(self, mean=None)

    def free_matrices(self) -> None:
        """Free what predictions would compute again."""
        for regression in self.regressions:
            if isinstance(regression, VHGP):
                regression.free_matrices()

    def with_independent_outputs(self) -> GaussianProcessPredictor:
        """See Predictor."""
        return replace(self, correlation=None)

    def _units(self, push: Push) -> Array:
        """Standard deviations of what was learnt, in units of the outcomes, (3,) or (n, 3)."""
        sd = self.scaling.outcome_sd
        return sd if self.mean is None else np.asarray(self.mean.size(push)[:, None] * sd)

    def _moments_of(self, latent: Sequence[LatentPrediction], correlation: Array | None) -> Moments:
        """Moments in SI units from latent predictions in standardised ones and correlation matrices (n, 3, 3)."""
        mean = np.column_stack([p.mean for p in latent]) * self.scaling.outcome_sd + self.scaling.outcome_mean
        of_function = np.column_stack([p.variance for p in latent]) * self.reported_sd**2
        of_process = np.column_stack([p.process_variance for p in latent]) * self.reported_sd**2
        return Moments(mean, *covariances(of_function, of_process, correlation))

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
