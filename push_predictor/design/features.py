# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a model is unsure of, as features: predicted outcomes are features times weights, and the weights are N(0, 1).

An outcome's mean function is J theta, of uncertain parameters theta of the mechanics, plus the residual that Gaussian
processes learn, plus the effects of an extended model. All are Gaussian: with a root R of a covariance, R R' = C, their
features are J R of the parameters and R itself of the functions. Common weights carry what two pushes share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from push_predictor.errors import RequestError
from push_predictor.models.effects.exact import covariance_of, joint
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.predictors import (
    ExtendedPredictor,
    GaussianProcessPredictor,
    MechanicsPredictor,
    Predictor,
    PriorPredictor,
)
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.types import Array

NEGLIGIBLE = 0.01  # of the noise variance: what is known that well is not resolved further


@dataclass(frozen=True, eq=False)
class Features:
    """values (n, 3, q): of the outcomes of n windows, in units of noise; noise_sd (n, 3): these units, m, m, rad."""

    values: Array
    noise_sd: Array


def features_of(model: PushModel, push: Push) -> Features:
    """The features of n windows. The posterior covariance of their mean functions is values @ values'.

    Raises RequestError for a model that is not unsure of anything, an analytical one with the textbook's parameters.
    """
    base = model.predictor.base
    noise_sd = np.sqrt(np.diagonal(_process_covariance(base, push), axis1=1, axis2=2))
    parts = []
    if isinstance(base, GaussianProcessPredictor):
        parts.append(_of_functions(base, push, noise_sd))
        if base.mean is not None:
            parts.append(_of_parameters(base.mean, push) / noise_sd[:, :, None])
    elif isinstance(base, MechanicsPredictor | PriorPredictor):
        parts.append(_of_parameters(base.fitted, push) / noise_sd[:, :, None])
    if isinstance(extended := model.predictor, ExtendedPredictor):  # its scale is on noise and base alike
        noise_sd = noise_sd * extended.scale
        parts.append(_of_effects(extended, push) / noise_sd[:, :, None])
    if not sum(part.shape[2] for part in parts):
        raise RequestError(
            "model", model.name, "one with something to learn: vhgp, gp, prior, or analytical with --fit"
        )
    return Features(np.concatenate(parts, axis=2), noise_sd)


def _process_covariance(base: Predictor, push: Push) -> Array:
    if isinstance(base, PriorPredictor):
        return base.process_covariance(push)
    return base.moments(push).process_covariance


def _of_functions(base: GaussianProcessPredictor, push: Push, noise_sd: Array) -> Array:
    """Features (n, 3, q) of what the regressions learn; each has weights of its own.

    What speeds beyond the training's add is not among them: a single push does not teach it.
    """
    at = base.scaling.features(base.rig.outline, push.inputs)
    unit = base.scaling.size(push.inputs, push.duration)[:, None] * base.reported_sd / noise_sd
    roots = [
        _root(unit[:, k, None] * regression.function_covariance(at) * unit[:, k])
        for k, regression in enumerate(base.regressions)
    ]
    features = np.zeros((len(at), 3, sum(root.shape[1] for root in roots)))
    begin = 0
    for k, root in enumerate(roots):
        features[:, k, begin : begin + root.shape[1]] = root
        begin += root.shape[1]
    return features


def _of_parameters(fitted: FittedMechanics, push: Push) -> Array:
    """Features (n, 3, p) in m, m, rad of the mechanics' uncertain parameters: derivatives times a root."""
    n = len(push.inputs)
    if not np.any(fitted.covariance):
        return np.zeros((n, 3, 0))
    names = tuple(fitted.values)
    slopes = fitted.shifted(names, np.zeros((n, len(names))), push)[1]
    return np.asarray(slopes.transpose(0, 2, 1) @ _symmetric_root(fitted.covariance))


def _of_effects(extended: ExtendedPredictor, push: Push) -> Array:
    """Features (n, 3, q) in m, m, rad of the effects' uncertain coefficients."""
    completed = extended.completed(push)
    designs = joint(extended.mechanics, extended.effects, completed).designs
    root = _symmetric_root(covariance_of(extended.effects, extended.cross))
    return np.asarray(np.concatenate(designs, axis=2) @ root)


def _root(covariance: Array) -> Array:
    """R (n, r) with R R' the covariance (n, n) in units of noise, but for a remainder of at most NEGLIGIBLE."""
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(covariance, tol=NEGLIGIBLE, lower=1)
    if covariance.diagonal().max() <= NEGLIGIBLE:
        rank = 0
    root = np.empty((len(covariance), rank))
    root[pivots - 1] = np.tril(factor[:, :rank])
    return root


def _symmetric_root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
