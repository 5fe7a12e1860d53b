# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A push model: from velocity, contact and angle to mean and covariance of (dx, dy, dtheta)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import RequestError
from push_predictor.geometry.boundary import within_box
from push_predictor.models.effects.covariates import CovariateRange, range_of
from push_predictor.models.features import push_features
from push_predictor.models.prediction import NOT_FINITE, Prediction
from push_predictor.models.predictors import (
    GaussianProcessPredictor,
    InputLimits,
    MechanicsPredictor,
    Moments,
    Predictor,
    PriorPredictor,
)
from push_predictor.models.pushes import Push, Pushes
from push_predictor.models.request import check_pushes
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import INPUTS, PushTable
from push_predictor.types import Array, BoolArray, IntArray

LEARNT = ("vhgp", "gp")
KINDS = (*LEARNT, "analytical", "prior")
USUAL_SPEED, USUAL_DURATION = 0.02, 0.2  # m/s, s: of the pushes of an untrained model
DURATION_TOLERANCE = 0.1  # a learnt model predicts durations this close (relative) to those it was trained on
DOMAIN_MARGIN = 1e-9  # rounding in unit conversions must not leave the domain


@dataclass(frozen=True)
class Provenance:
    """Where a model comes from: names of its recordings or tables, how many pushes, seed, version of this package."""

    sources: tuple[str, ...]
    pushes: int
    seed: int
    version: str


@dataclass(frozen=True, eq=False, repr=False)
class PushModel:
    """A named model with everything that is needed to use and evaluate it.

    training: the rows it was trained on, covariates included. kind: that of the base, where effects extend it.
    """

    name: str
    kind: str
    rig: Rig
    predictor: Predictor
    training: PushTable
    provenance: Provenance

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a model file; an older file is replaced when the new one is complete. Raises OSError."""
        from push_predictor.models.store.model_file import save_model  # the store knows models, not the reverse

        save_model(self, Path(path))

    def __repr__(self) -> str:
        defaults = f"  defaults of covariates: {defaults_in_words(self)}\n" if self.defaults else ""
        return (
            f"PushModel {self.name!r} ({self.kind}): slider {self.rig.shape} on {self.rig.surface}\n"
            f"{self._training_in_words()}"
            f"  mean: {mean_in_words(self.predictor)}\n"
            f"  needs covariates: {', '.join(self.needs) or 'none'}\n"
            f"{defaults}"
            f"  made by push_predictor {self.provenance.version}, seed {self.provenance.seed}"
        )

    def _training_in_words(self) -> str:
        if not len(self.training):
            return "  trained on no push: outline and priors alone\n"
        speeds, durations = 1e3 * self.training.inputs[:, 0], self.training.duration
        origin = f" from {', '.join(self.provenance.sources)}" if self.provenance.sources else ""
        return (
            f"  trained on {len(self.training)} windows of {self.provenance.pushes} pushes{origin}\n"
            f"  pusher speed {speeds.min():.3g} to {speeds.max():.3g} mm/s, windows of {np.median(durations):.3g} s\n"
        )

    def predict(self, pushes: Pushes) -> Prediction:
        """Predict the outcomes of n pushes.

        Raises RequestError that names the field, its value and what is accepted, for a push that the model cannot
        predict or that lacks a covariate the model needs.
        """
        check_pushes(self, pushes)
        found = self.predict_rows(pushes.inputs, pushes.duration, pushes.covariates)
        if (bad := found.first_not_finite) is not None:
            raise RequestError(f"velocity[{bad}]", float(pushes.inputs[bad, 0]), f"a push to predict: {NOT_FINITE}")
        return found

    def predict_rows(self, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None) -> Prediction:
        """Predict n pushes unchecked: inputs (n, 3: velocity m/s, contact, angle rad), duration (n,) s, covariates.

        `predict` checks them first, `check_requests` those of the services. Raises KeyError where one of the
        covariates that the model needs is missing; others are ignored.
        """
        push = Push(inputs, duration, covariates or {})
        inside = self.supported(push)
        with one_blas_thread() if self.predictor.learnt else nullcontext():
            return Prediction(*self.predictor.moments(push), inside, self.predictor.tails)

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that every push must bring; none unless the model is extended."""
        return self.predictor.needs

    @property
    def defaults(self) -> Mapping[str, float]:
        """The values of covariates that a push may omit, by name: those at the end of the trace."""
        return self.predictor.defaults

    @cached_property
    def accepted(self) -> tuple[str, ...]:
        """Names of the covariates that a push may bring."""
        return (*self.needs, *self.defaults)

    def continued(self, table: PushTable) -> PushTable:
        """The rows of a recording with the cumulative covariates that this model predicts with.

        Those of an extended model go on from its trace, see TracedSession.
        """
        return self.predictor.session.continued(table)

    @cached_property
    def base(self) -> PushModel:
        """The model without its effects; itself if it has none."""
        return replace(self, predictor=self.predictor.base) if self.predictor.effects else self

    def held_out_moments(self, block: IntArray | None = None) -> Moments:
        """Moments at the n training rows, each predicted without the rows of its block; hyperparameters are kept.

        block (n,): number of each row's block; None for leave-one-push-out. An analytical base was not fitted as a
        function of the inputs, so its moments are those of `predict_rows`.
        """
        rows = self.training
        if block is None:
            block = np.unique(rows.push_id, return_inverse=True)[1]
        with one_blas_thread():
            return self.predictor.held_out_moments(Push.of(rows), block)

    def exact_log_density(self, table: PushTable) -> Array | None:
        """Log density (n, 3) of a table's outcomes under the exact predictive, None if that is a Gaussian."""
        with one_blas_thread():
            return self.predictor.exact_log_density(Push.of(table), table.outcomes)

    def in_domain(self, inputs: Array) -> BoolArray:
        """Whether each of the pushes (n, 3) lies in the box that the training pushes span in feature space.

        The domain of a prior model are all pushes for which its priors are meant. For covariates see
        `supported`.
        """
        points = inputs if self.predictor.own_limits else push_features(self.rig.outline, inputs)
        found = np.empty(len(inputs), dtype=np.uint8)
        within_box(points, *self._domain, found)
        return found.view(np.bool_)

    def supported(self, push: Push) -> BoolArray:
        """Whether each of n pushes lies in the domain, with covariates in the range on which the effects were fitted.

        Raises KeyError where a covariate is missing.
        """
        inside = self.in_domain(push.inputs)
        if self.covariate_ranges:
            covariates = self.predictor.completed(push).covariates
            for name, known in self.covariate_ranges.items():
                inside &= known.contains(covariates[name])
        return inside

    @cached_property
    def input_limits(self) -> InputLimits:
        """Velocities and angles of the domain; inside them a contact may be outside, see `in_domain`."""
        if (own := self.predictor.own_limits) is not None:
            return own
        low, high = self.training.inputs.min(axis=0).tolist(), self.training.inputs.max(axis=0).tolist()
        return InputLimits((low[0], high[0]), (low[2], high[2]))

    @cached_property
    def covariate_ranges(self) -> dict[str, CovariateRange]:
        """The range in the training rows of each covariate that the effects depend on.

        A range contains the default. A step along a covariate that only grows is past, so that it has no range. For
        the model's own inputs see `in_domain`.
        """
        if not self.predictor.covariates:
            return {}
        rows = self.training
        known = self.predictor.completed(Push.of(rows)).covariates
        names = [name for name in self.predictor.covariates if name not in (*INPUTS, *self.predictor.past)]
        ranges = {name: range_of(name, known[name]) for name in names}
        return {name: found.reaching(self.defaults.get(name, found.high)) for name, found in ranges.items()}

    @cached_property
    def training_mean(self) -> Array:
        """Mean outcome (3,) of the training rows: the reference of the NMSE. Zero, no motion, if there are none."""
        return np.asarray(self.training.outcomes.mean(axis=0)) if len(self.training) else np.zeros(3)

    @cached_property
    def usual_speed(self) -> float:
        """Median speed of the training pushes, m/s."""
        return float(np.median(self.training.inputs[:, 0])) if len(self.training) else USUAL_SPEED

    @cached_property
    def usual_duration(self) -> float:
        """Median duration of the training windows, s."""
        return float(np.median(self.training.duration)) if len(self.training) else USUAL_DURATION

    def examples(self, count: int) -> Push:
        """Some pushes that the model predicts: training rows, or pushes all around the slider if there are none."""
        if len(self.training):
            rows = self.training.take(np.linspace(0, len(self.training) - 1, count).astype(int))
            return Push.of(rows)
        contact, angle = np.arange(count) / count, np.linspace(-1.0, 1.0, count)
        inputs = np.column_stack([np.full(count, USUAL_SPEED), contact, angle])
        return Push(inputs, np.full(count, USUAL_DURATION), {})

    @cached_property
    def duration_range(self) -> tuple[float, float]:
        """Durations (s) that this model can predict."""
        if not self.predictor.learnt:
            return 0.0, float("inf")
        durations = self.training.duration
        return (1.0 - DURATION_TOLERANCE) * durations.min(), (1.0 + DURATION_TOLERANCE) * durations.max()

    @cached_property
    def _domain(self) -> tuple[Array, Array]:
        """Lowest and highest inputs (3,) of a model with limits of its own, else features (D,)."""
        if (own := self.predictor.own_limits) is not None:
            (slowest, fastest), (least, most) = own
            return np.array([slowest, -np.inf, least]), np.array([fastest, np.inf, most])
        features = push_features(self.rig.outline, self.training.inputs)
        low, high = features.min(axis=0), features.max(axis=0)
        margin = DOMAIN_MARGIN + 1e-6 * np.abs(high)
        return low - margin, high + margin


def mean_of(predictor: Predictor) -> str:
    """What the base of a predictor predicts with before it has learnt anything."""
    base = predictor.base
    if isinstance(base, GaussianProcessPredictor):
        per_path = "" if base.scaling.travel is not None else ", not per path length"
        return ("zero" if base.mean is None else "fitted mechanics") + per_path
    if _is_textbook(predictor):
        return "textbook mechanics"
    return "mechanics with uncertain parameters" if isinstance(base, PriorPredictor) else "fitted mechanics"


def mean_parameters(predictor: Predictor) -> dict[str, float]:
    """The parameters of these mechanics by name, in the units of PARAMETERS; empty for the textbook's, and for none."""
    base = predictor.base
    if _is_textbook(predictor) or (isinstance(base, GaussianProcessPredictor) and base.mean is None):
        return {}
    return {name: float(value) for name, value in base.mechanics.values.items()}


def _is_textbook(predictor: Predictor) -> bool:
    base = predictor.base
    return isinstance(base, MechanicsPredictor) and not base.fitted.covariance.any()


def defaults_in_words(model: PushModel) -> str:
    """The defaults on one line, empty if there are none."""
    return ", ".join(f"{name} {value:.4g}" for name, value in model.defaults.items())


def mean_in_words(predictor: Predictor) -> str:
    """Both on one line."""
    values = ", ".join(f"{name} {value:.3g}" for name, value in mean_parameters(predictor).items())
    return f"{mean_of(predictor)} ({values})" if values else mean_of(predictor)
