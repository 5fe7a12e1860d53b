"""What the kinds of push models differ in: learnt, analytical, and either of them extended by effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, TypeAlias

import numpy as np

from push_predictor.models.correlation import Correlation, covariances
from push_predictor.models.effects.effect import Effect
from push_predictor.models.features import push_features
from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.quadrature import exact_log_density
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms import Push
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import INPUTS
from push_predictor.types import Array

SIDE = "edge"
TOLD_BY_PUSH = (*INPUTS, SIDE)  # covariates that no request needs to bring
Cross: TypeAlias = Mapping[tuple[int, int], Array]


class Predictor(Protocol):
    """What the kinds of models differ in."""

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that every push must bring."""

    def moments(self, push: Push) -> tuple[Array, Array, Array]:
        """Mean (n, 3), covariance (n, 3, 3) of an outcome, process covariance (n, 3, 3)."""

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
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
class GaussianProcessPredictor:
    """Three independent regressions on standardised features (Bauza and Rodriguez 2017, section IV), and how what they
    leave over goes together; None where it does not.
    """

    rig: Rig
    scaling: Scaling
    regressions: tuple[GaussianProcess | VHGP | SparseVHGP, ...]
    correlation: Correlation | None = None

    @property
    def needs(self) -> tuple[str, ...]:
        """See Predictor: none."""
        return ()

    def moments(self, push: Push) -> tuple[Array, Array, Array]:
        """See Predictor. Every outcome takes the duration of the training windows; the caller has checked it."""
        features = scaled_features(self.rig, self.scaling, push.inputs)
        latent = [regression.predict(features) for regression in self.regressions]
        return self.moments_of(latent, self.correlation.at(features) if self.correlation else None)

    def moments_of(self, latent: Sequence[LatentPrediction], correlation: Array | None) -> tuple[Array, Array, Array]:
        """See Predictor.moments, of latent predictions in standardised units and correlation matrices (n, 3, 3)."""
        sd = self.scaling.outcome_sd
        mean = np.column_stack([p.mean for p in latent]) * sd + self.scaling.outcome_mean
        of_function = np.column_stack([p.variance for p in latent]) * sd**2
        of_process = np.column_stack([p.process_variance for p in latent]) * sd**2
        return mean, *covariances(of_function, of_process, correlation)

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """See Predictor; None for the standard GP, whose predictive is Gaussian."""
        return self.log_density(self.latent(push.inputs), outcomes) if self.exact else None

    @property
    def exact(self) -> bool:
        """Whether the exact predictive is another than the Gaussian of its moments."""
        return all(isinstance(regression, VHGP | SparseVHGP) for regression in self.regressions)

    @property
    def outcomes(self) -> Array:
        """The outcomes (n, 3) that it was trained on, SI."""
        scaled = np.column_stack([regression.outputs for regression in self.regressions])
        return np.asarray(scaled * self.scaling.outcome_sd + self.scaling.outcome_mean)

    def latent(self, inputs: Array) -> list[LatentPrediction]:
        """Per output, the latent predictions in standardised units."""
        features = scaled_features(self.rig, self.scaling, inputs)
        return [regression.predict(features) for regression in self.regressions]

    def log_density(self, latent: Sequence[LatentPrediction], outcomes: Array) -> Array:
        """Log density (n, 3) of outcomes (n, 3) under latent predictions in standardised units, one per output."""
        scaled = (outcomes - self.scaling.outcome_mean) / self.scaling.outcome_sd
        columns = [exact_log_density(p, scaled[:, k]) for k, p in enumerate(latent)]
        return np.column_stack(columns) - np.log(self.scaling.outcome_sd)


@dataclass(frozen=True, eq=False)
class AnalyticalPredictor:
    """The quasi-static model of Lynch et al. 1992 with one covariance for all pushes, (3, 3)."""

    physics: AnalyticalPush
    covariance: Array

    @property
    def needs(self) -> tuple[str, ...]:
        """See Predictor: none."""
        return ()

    def moments(self, push: Push) -> tuple[Array, Array, Array]:
        """See Predictor."""
        mean = self.physics.displacement(push.inputs, push.duration)
        covariance = np.broadcast_to(self.covariance, (len(mean), 3, 3)).copy()
        return mean, covariance, covariance.copy()

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """See Predictor: the predictive is Gaussian."""
        return None


@dataclass(frozen=True, eq=False)
class ExtendedPredictor:
    """A base with effects that it lacks: each shifts the mean and adds its own uncertainty to the covariance.

    physics: the analytical model from which the effects' responses are computed. scale (3,): what the base's standard
    deviations of dx, dy, dtheta are multiplied by, found once the effects are in. cross: for effects i < j that were
    estimated jointly, the covariance (coefficients of i, coefficients of j); what is not in it is independent. Without
    it two effects whose drivers go together would be told as far less certain than their sum is.
    """

    base: GaussianProcessPredictor | AnalyticalPredictor
    physics: AnalyticalPush
    effects: tuple[Effect, ...]
    scale: Array
    cross: Cross = field(default_factory=dict)

    @cached_property
    def takes(self) -> tuple[str, ...]:
        """The covariates that its effects take, each name once."""
        return tuple(dict.fromkeys(name for effect in self.effects for name in effect.needs))

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """See Predictor: what its effects take and the push itself does not tell."""
        return tuple(name for name in self.takes if name not in TOLD_BY_PUSH)

    def completed(self, push: Push) -> Push:
        """The push with what its inputs tell among its covariates, where an effect takes it."""
        told = dict(zip(INPUTS, push.inputs.T, strict=True))
        if SIDE in self.takes:
            told[SIDE] = self.physics.outline.edge(push.inputs[:, 1])[0].astype(np.float64)
        own = {name: column for name, column in told.items() if name in self.takes}
        return replace(push, covariates={**push.covariates, **own}) if own else push

    def moments(self, push: Push) -> tuple[Array, Array, Array]:
        """See Predictor."""
        return self.extended(self.base.moments(push), push)

    def extended(self, moments: tuple[Array, Array, Array], push: Push) -> tuple[Array, Array, Array]:
        """The moments of the base, computed by whatever means, with the effects in them."""
        mean, total, process = moments
        shift, unsure = self.shift(push)
        factor = np.outer(self.scale, self.scale)
        return mean + shift, total * factor + unsure, process * factor

    def shift(self, push: Push) -> tuple[Array, Array]:
        """Sum of the effects' shifts (n, 3), and its covariance (n, 3, 3)."""
        shift, unsure = np.zeros((len(push.inputs), 3)), np.zeros((len(push.inputs), 3, 3))
        push = self.completed(push)
        designs = [effect.design(self.physics, push) for effect in self.effects]
        for effect, design in zip(self.effects, designs, strict=True):
            shift = shift + design @ effect.coefficients
            unsure = unsure + design @ effect.covariance @ design.transpose(0, 2, 1)
        for (i, j), covariance in self.cross.items():
            shared = designs[i] @ covariance @ designs[j].transpose(0, 2, 1)
            unsure = unsure + shared + shared.transpose(0, 2, 1)
        return shift, unsure

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """See Predictor: the latent function of the base is shifted and less certain, its noise is scaled."""
        base = self.base
        if isinstance(base, AnalyticalPredictor) or not base.exact:
            return None
        shift, unsure = self.shift(push)
        shift, sd = shift / base.scaling.outcome_sd, base.scaling.outcome_sd
        variance = np.diagonal(unsure, axis1=1, axis2=2) / sd**2
        latent = [
            replace(
                p,
                mean=p.mean + shift[:, k],
                variance=p.variance * self.scale[k] ** 2 + variance[:, k],
                log_noise_mean=p.log_noise_mean + 2.0 * np.log(self.scale[k]),
            )
            for k, p in enumerate(base.latent(push.inputs))
        ]
        return base.log_density(latent, outcomes)


def with_independent_outputs(
    predictor: GaussianProcessPredictor | AnalyticalPredictor | ExtendedPredictor,
) -> GaussianProcessPredictor | AnalyticalPredictor | ExtendedPredictor:
    """The same body without what a learnt one knows of how its outputs go together."""
    if isinstance(predictor, ExtendedPredictor) and isinstance(predictor.base, GaussianProcessPredictor):
        return replace(predictor, base=replace(predictor.base, correlation=None))
    return replace(predictor, correlation=None) if isinstance(predictor, GaussianProcessPredictor) else predictor


def scaled_features(rig: Rig, scaling: Scaling, inputs: Array) -> Array:
    """Standardised features (n, D) of inputs (n, 3)."""
    features = push_features(rig.outline, inputs)[:, scaling.columns]
    return np.asarray((features - scaling.feature_mean) / scaling.feature_sd)
