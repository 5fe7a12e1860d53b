"""A push model: from velocity, contact and angle to mean and covariance of (dx, dy, dtheta)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from push_predictor.models.analytical import AnalyticalPush
from push_predictor.models.features import push_features
from push_predictor.models.gp import GaussianProcess
from push_predictor.models.prediction import LatentPrediction
from push_predictor.models.quadrature import exact_log_density
from push_predictor.models.vhgp import VHGP
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.types import Array, BoolArray

KINDS = ("vhgp", "gp", "analytical")
DURATION_TOLERANCE = 0.1  # a learnt model answers for durations this close (relative) to those it was trained on
DOMAIN_MARGIN = 1e-9  # rounding in unit conversions must not leave the domain


@dataclass(frozen=True, eq=False)
class Prediction:
    """n predicted outcomes in the push frame (dx m, dy m, dtheta rad).

    mean (n, 3); covariance (n, 3, 3) of an observed outcome; process_covariance (n, 3, 3), the noise alone;
    in_domain (n,), whether the push lies inside the domain of the training data.
    """

    mean: Array
    covariance: Array
    process_covariance: Array
    in_domain: BoolArray


@dataclass(frozen=True)
class Provenance:
    """Where a model comes from: names of its recordings or tables, how many pushes, seed, version of this package."""

    sources: tuple[str, ...]
    pushes: int
    seed: int
    version: str


class Body(Protocol):
    """What the kinds of models differ in."""

    def moments(self, inputs: Array, duration: Array) -> tuple[Array, Array, Array]:
        """Mean (n, 3), covariance (n, 3, 3) of an outcome, process covariance (n, 3, 3)."""

    def exact_log_density(self, inputs: Array, outcomes: Array) -> Array | None:
        """Log density (n, 3) of outcomes under the exact predictive, or None where it is the Gaussian."""


@dataclass(frozen=True, eq=False)
class Scaling:
    """Standardisation: the features that vary (columns), their mean and sd, and those of the three outcomes."""

    columns: tuple[int, ...]
    feature_mean: Array
    feature_sd: Array
    outcome_mean: Array
    outcome_sd: Array


@dataclass(frozen=True, eq=False)
class LearnedBody:
    """Three independent regressions on standardised features (Bauza and Rodriguez 2017, section IV)."""

    rig: Rig
    scaling: Scaling
    regressions: tuple[GaussianProcess | VHGP, ...]

    def moments(self, inputs: Array, duration: Array) -> tuple[Array, Array, Array]:
        """See Body. Every outcome takes the duration of the training windows; the caller has checked it."""
        latent = self.latent(inputs)
        sd = self.scaling.outcome_sd
        mean = np.column_stack([p.mean for p in latent]) * sd + self.scaling.outcome_mean
        total = np.column_stack([p.outcome_variance for p in latent]) * sd**2
        process = np.column_stack([p.process_variance for p in latent]) * sd**2
        return mean, _diagonal(total), _diagonal(process)

    def exact_log_density(self, inputs: Array, outcomes: Array) -> Array | None:
        """See Body; None for the standard GP, whose predictive is Gaussian."""
        if not all(isinstance(regression, VHGP) for regression in self.regressions):
            return None
        scaled = (outcomes - self.scaling.outcome_mean) / self.scaling.outcome_sd
        columns = [exact_log_density(p, scaled[:, k]) for k, p in enumerate(self.latent(inputs))]
        return np.column_stack(columns) - np.log(self.scaling.outcome_sd)

    def latent(self, inputs: Array) -> list[LatentPrediction]:
        """Per output, the latent predictions in standardised units."""
        features = scaled_features(self.rig, self.scaling, inputs)
        return [regression.predict(features) for regression in self.regressions]


@dataclass(frozen=True, eq=False)
class AnalyticalBody:
    """The quasi-static model of Lynch et al. 1992 with one covariance for all pushes, (3, 3)."""

    physics: AnalyticalPush
    covariance: Array

    def moments(self, inputs: Array, duration: Array) -> tuple[Array, Array, Array]:
        """See Body."""
        mean = self.physics.displacement(inputs, duration)
        covariance = np.broadcast_to(self.covariance, (len(mean), 3, 3)).copy()
        return mean, covariance, covariance.copy()

    def exact_log_density(self, inputs: Array, outcomes: Array) -> Array | None:
        """See Body: the predictive is Gaussian."""
        return None


@dataclass(frozen=True, eq=False)
class PushModel:
    """A named model with everything that is needed to use it and to judge it.

    training: the rows it was trained on, covariates included.
    """

    name: str
    kind: str
    rig: Rig
    body: LearnedBody | AnalyticalBody
    training: PushTable
    provenance: Provenance

    def predict(self, inputs: Array, duration: Array) -> Prediction:
        """Predict n pushes: inputs (n, 3: velocity m/s, contact, angle rad), duration (n,) s.

        The caller checks requests from outside with `check_requests`; this does not.
        """
        mean, covariance, process = self.body.moments(inputs, duration)
        return Prediction(mean, covariance, process, self.in_domain(inputs))

    def exact_log_density(self, table: PushTable) -> Array | None:
        """Log density (n, 3) of a table's outcomes under the exact predictive, None where that is the Gaussian."""
        return self.body.exact_log_density(table.inputs, table.outcomes)

    def in_domain(self, inputs: Array) -> BoolArray:
        """Whether each of the pushes (n, 3) lies in the box that the training pushes span in feature space."""
        low, high = self._feature_range
        features = push_features(self.rig.outline, inputs)
        margin = DOMAIN_MARGIN + 1e-6 * np.abs(high)
        return np.asarray(np.all((features >= low - margin) & (features <= high + margin), axis=1))

    @cached_property
    def training_mean(self) -> Array:
        """Mean outcome (3,) of the training rows: the reference of the NMSE."""
        return np.asarray(self.training.outcomes.mean(axis=0))

    @cached_property
    def duration_range(self) -> tuple[float, float]:
        """Durations (s) that this model answers for."""
        if self.kind == "analytical":
            return 0.0, float("inf")
        durations = self.training.duration
        return (1.0 - DURATION_TOLERANCE) * durations.min(), (1.0 + DURATION_TOLERANCE) * durations.max()

    @cached_property
    def _feature_range(self) -> tuple[Array, Array]:
        features = push_features(self.rig.outline, self.training.inputs)
        return features.min(axis=0), features.max(axis=0)


def scaled_features(rig: Rig, scaling: Scaling, inputs: Array) -> Array:
    """Standardised features (n, D) of inputs (n, 3)."""
    features = push_features(rig.outline, inputs)[:, scaling.columns]
    return np.asarray((features - scaling.feature_mean) / scaling.feature_sd)


def _diagonal(variances: Array) -> Array:
    matrices = np.zeros((len(variances), len(OUTPUTS), len(OUTPUTS)))
    index = np.arange(len(OUTPUTS))
    matrices[:, index, index] = variances
    return matrices
