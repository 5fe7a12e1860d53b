# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Training of learnt predictors: plain, or about fitted mechanics (docs/explanation/informed_models.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.features import push_features, within
from push_predictor.models.gaussian_process.bound import VhgpParameters
from push_predictor.models.gaussian_process.gp import SHORTEST, GpParameters, fit_gp
from push_predictor.models.gaussian_process.prediction import exact_log_density
from push_predictor.models.gaussian_process.regression import Regression, best_held_out, fit_constant
from push_predictor.models.gaussian_process.sparse_vhgp import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.models.mechanics.fit import fit_jointly, held_out_residuals
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import mechanics_on
from push_predictor.models.mechanics.ladder import candidates
from push_predictor.models.mechanics.parameters import BY_NAME, QUASI_STATIC
from push_predictor.models.predictors import GaussianProcessPredictor, Scaling
from push_predictor.models.predictors.correlation import MOST_BLOCKS, fit_correlation
from push_predictor.models.predictors.tails import fit_tails
from push_predictor.models.pushes import Push
from push_predictor.models.train_mechanics import fit_rows
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.types import Array, IntArray
from push_predictor.watch import Watch, no_watch, part_of

if TYPE_CHECKING:
    from push_predictor.models.train import TrainingOptions

MeanChoice = Literal["mechanics", "zero", "auto"]
MEANS: tuple[MeanChoice, ...] = ("mechanics", "zero", "auto")
CONSTANT = 1e-9  # a feature whose range is below this fraction of its size counts as constant
# Lengthscale of a residual's mean, in standard deviations of the inputs. Windows of one push are close to each other
# and deviate together: with shorter ones a regression learns the push.
SHORTEST_OF_RESIDUAL = 0.7
ONE_SPEED = 1.2  # ratio of speeds up to which they count as one
EXACT = 1e-6  # of the outcomes' standard deviation: a residual is not scaled by less


def train_learnt(
    rows: PushTable, of_mean: PushTable, rig: Rig, kind: str, options: TrainingOptions, watch: Watch
) -> GaussianProcessPredictor:
    """The predictor trained on the rows; of_mean: those of them that the mechanics are fitted to.

    kind: vhgp or gp. options.inducing: None for a dense model. With the mean `auto`, the rows of_mean decide about it,
    by a GP of each: see `zero_is_better`. Raises TrainingError for outcomes that do not vary.
    """
    _check_rows(rows, rig)
    about, near = None, options.near
    if options.about is not None:
        about = FittedMean(options.about, rows.outcomes - _moved(options.about, rows))
    elif options.mean != "zero":
        watch(f"train {kind}: mechanics as mean", 0.0)
        about = fitted_mean(of_mean, rig)
    if options.about is None and about is not None and options.mean == "auto":
        watch(f"train {kind}: choice of the mean", 0.2)
        each = [_trained(of_mean, rig, "gp", options, mean, rough=True) for mean in (None, about)]
        zero, mechanics = (trained.density(of_mean) for trained in each)
        about = None if zero_is_better(zero, mechanics) else about
        chosen = each[0 if about is None else 1]
        near = replace(chosen.predictor, regressions=chosen.fitted)
    trained = _trained(rows, rig, kind, options, about, part_of(watch, 0.3, 0.9), near)
    watch(f"train {kind}: correlation and tails", 0.9)
    return _completed(trained, rows, tails=options.tails)


def zero_is_better(zero: Array, mechanics: Array) -> bool:
    """Whether the mean zero is better than mechanics by more than the standard error of the difference over pushes.

    zero, mechanics (pushes,): log density of each held-out push, in nats. In the domain of the training both means are
    often as good, but only mechanics know what happens outside of it. So a tie goes to mechanics, and so does a single
    push.
    """
    gain = zero - mechanics
    return len(gain) > 1 and bool(gain.sum() > np.sqrt(len(gain)) * gain.std(ddof=1))


def _completed(trained: _Trained, rows: PushTable, *, tails: bool) -> GaussianProcessPredictor:
    """The predictor with what only held-out pushes show: the correlation of the outputs, and the tails."""
    predictor = replace(trained.predictor, correlation=fit_correlation(trained.predictor.regressions, rows.push_id))
    if not tails:
        return predictor
    push = Push.of(rows)
    learnt = predictor.of_targets().held_out_moments(push, _blocks(rows))
    counts = [regression.parameters.count for regression in predictor.regressions]
    fitted = fit_tails(trained.observed - learnt.mean, learnt.covariance, rows.push_id, counts)
    return replace(predictor, tails=fitted)


@dataclass(frozen=True, eq=False)
class FittedMean:
    """Mechanics as mean. residuals (m, 3): of the rows that it was fitted to, each push under a fit without it, SI."""

    mean: FittedMechanics
    residuals: Array


def fitted_mean(rows: PushTable, rig: Rig) -> FittedMean:
    """All parameters of the mechanics that velocity, contact and angle show, fitted jointly under their priors.

    Those that need a covariate stay at their textbook values, so that a push needs nothing else than before. So does
    inertia where all pushes are slow.
    """
    mechanics, known = mechanics_on(rig.outline, rig.pusher_radius, rig.support_points), fit_rows(rows)
    names = [name for name in candidates(mechanics, known) if not BY_NAME[name].needs]
    if float(rows.inputs[:, 0].max()) < QUASI_STATIC:
        names = [name for name in names if name != "inertia"]
    fit = fit_jointly(mechanics, known, names)
    return FittedMean(FittedMechanics(mechanics, fit.values, fit.covariance), held_out_residuals(mechanics, fit))


def _moved(mean: FittedMechanics, rows: PushTable) -> Array:
    return mean.displacement(rows.inputs, rows.duration, rows.covariates)


@dataclass(frozen=True, eq=False)
class _Trained:
    """A predictor, and what held-out training pushes showed it to learn.

    observed (n, 3): outcomes, or residuals about the mean as it is without the push, SI, at a path of the scaling's
    travel. fitted: the regression of each output, also where its noise alone predicts held-out pushes better.
    """

    predictor: GaussianProcessPredictor
    observed: Array
    fitted: tuple[Regression, ...]

    def density(self, rows: PushTable) -> Array:
        """Log density (pushes,) of each held-out training push, less its share of the hyperparameters, nats.

        In units of what was learnt, at the same path length for all means.
        """
        predictor, block = self.predictor, _blocks(rows)
        density = np.zeros(len(rows))
        for regression, seen in zip(predictor.regressions, predictor.scaling.outcomes(self.observed).T, strict=True):
            density += exact_log_density(regression.held_out(block), seen)
        push = np.unique(rows.push_id, return_inverse=True)[1]
        counts = sum(regression.parameters.count for regression in predictor.regressions)
        units = float(np.log(predictor.scaling.outcome_sd).sum())
        by_push = np.bincount(push, density - units)
        return np.asarray(by_push - counts / len(by_push))


def _trained(
    rows: PushTable,
    rig: Rig,
    kind: str,
    options: TrainingOptions,
    about: FittedMean | None,
    watch: Watch = no_watch,
    near: GaussianProcessPredictor | None = None,
    *,
    rough: bool = False,
) -> _Trained:
    """near: regressions of similar rows about the same mean, where the search of a VHGP begins.

    rough: whether a GP is only to be compared.
    """
    mean = None if about is None else about.mean
    path = rows.inputs[:, 0] * rows.duration
    size = (path / path.mean() if options.per_path else np.ones(len(path)))[:, None]
    targets = (rows.outcomes if mean is None else rows.outcomes - _moved(mean, rows)) / size
    # With more rows than the mechanics are fitted to, these are as good as held out.
    observed = about.residuals / size if about is not None and len(about.residuals) == len(rows) else targets
    speeds = _speeds(rows) if options.per_path else None
    scaling = _scaling(rows, rig, targets, speeds, centred=mean is None)
    if options.per_path:
        scaling = replace(scaling, travel=float(path.mean()))
    features, block = scaling.features(rig.outline, rows.inputs), _blocks(rows)
    starts, shortest = _starts(near, scaling), SHORTEST if mean is None else SHORTEST_OF_RESIDUAL
    columns, seen = scaling.outcomes(targets).T, scaling.outcomes(observed).T

    fitted: list[Regression] = []
    chosen: list[Regression] = []
    for k, name in enumerate(OUTPUTS):
        watch(f"train {kind}: {name}", k / len(OUTPUTS))
        if kind == "gp":
            fitted.append(fit_gp(features, columns[k], shortest=shortest, rough=rough))
        elif options.inducing is None:
            smooth = mean is not None
            fitted.append(fit_vhgp(features, columns[k], start=starts[k], shortest=shortest, rough=smooth))
        else:
            fitted.append(fit_sparse_vhgp(features, columns[k], options.inducing))
        chosen.append(fitted[k])
        if mean is not None:
            constant = fit_constant(features, columns[k], heavy_tails=kind != "gp", observed=seen[k])
            chosen[k] = best_held_out([constant, fitted[k]], block, seen[k])
    predictor = GaussianProcessPredictor(rig, scaling, tuple(chosen), mean=mean)
    return _Trained(predictor, observed, tuple(fitted))


def _speeds(rows: PushTable) -> tuple[float, float]:
    """Slowest and fastest speed of the pushes; single windows are noisy, and so are single pushes."""
    push = np.unique(rows.push_id, return_inverse=True)[1]
    of_push = np.bincount(push, rows.inputs[:, 0]) / np.bincount(push)
    low, high = np.quantile(of_push, [0.05, 0.95])
    if high < ONE_SPEED * low:
        low = high = np.median(of_push)
    return float(low), float(high)


def _blocks(rows: PushTable) -> IntArray:
    """The block (n,) in which each row is held out: its push, or a group of pushes."""
    return np.asarray(np.unique(rows.push_id, return_inverse=True)[1] % MOST_BLOCKS, dtype=np.int64)


def _starts(near: GaussianProcessPredictor | None, scaling: Scaling) -> list[GpParameters | None]:
    """Hyperparameters of each output's GP, where there is one of the same features."""
    if near is None or near.scaling.columns != scaling.columns:
        return [None] * len(OUTPUTS)
    return [_alike(regression) for regression in near.regressions]


def _alike(regression: Regression) -> GpParameters | None:
    """Those of a GP with the signal and the mean noise variance of a regression; None of noise alone."""
    parameters = regression.parameters
    if isinstance(parameters, VhgpParameters):
        noise = parameters.noise_mean + 0.5 * (parameters.noise.variance + parameters.nugget)
        return GpParameters(parameters.log_lengthscales, parameters.log_signal_sd, 0.5 * noise)
    return parameters if isinstance(parameters, GpParameters) else None


def _scaling(
    rows: PushTable, rig: Rig, targets: Array, speeds: tuple[float, float] | None, *, centred: bool
) -> Scaling:
    """centred: whether the mean of the targets (n, 3) is subtracted; a residual has mean zero."""
    features = push_features(rig.outline, within(speeds, rows.inputs))
    columns = _varying(features)
    used = features[:, columns]
    if centred:
        mean, sd = targets.mean(axis=0), targets.std(axis=0)
    else:
        mean, sd = np.zeros(len(OUTPUTS)), np.sqrt(np.mean(targets**2, axis=0)) + EXACT * rows.outcomes.std(axis=0)
    return Scaling(tuple(int(c) for c in columns), used.mean(axis=0), used.std(axis=0), mean, sd, speeds=speeds)


def _check_rows(rows: PushTable, rig: Rig) -> None:
    for name, sd in zip(OUTPUTS, rows.outcomes.std(axis=0), strict=True):
        if not sd > 0.0:
            raise TrainingError(
                f"{name}: does not vary over the {len(rows)} training windows: there is nothing to learn"
            )
    if not _varying(push_features(rig.outline, rows.inputs)).size:
        raise TrainingError(
            "velocity, contact and angle are the same in all training windows: there is nothing to learn"
        )


def _varying(features: Array) -> IntArray:
    """Columns of the features (n, m) that are not the same in all rows."""
    return np.flatnonzero(np.ptp(features, axis=0) > CONSTANT * (1.0 + np.abs(features).max(axis=0)))
