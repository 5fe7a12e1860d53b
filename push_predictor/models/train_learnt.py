"""Training of learnt predictors: plain, or about fitted mechanics (docs/explanation/informed_models.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.features import push_features
from push_predictor.models.gaussian_process.constant import fit_constant
from push_predictor.models.gaussian_process.gp import fit_gp
from push_predictor.models.gaussian_process.kernels import DEFAULT_CHOICE, KernelChoice
from push_predictor.models.gaussian_process.regression import Regression, best_held_out, held_out_score
from push_predictor.models.gaussian_process.sparse.fit import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.models.mechanics.fit import fit_jointly
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.ladder import candidates
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import GaussianProcessPredictor, MechanicsMean, Scaling
from push_predictor.models.predictors.correlation_fit import MOST_BLOCKS, fit_correlation
from push_predictor.models.train_mechanics import fit_rows
from push_predictor.models.watch import Watch
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.types import Array, IntArray

MeanChoice = Literal["mechanics", "zero", "auto"]
MEANS: tuple[MeanChoice, ...] = ("mechanics", "zero", "auto")
CONSTANT = 1e-9  # a feature whose range is below this fraction of its size counts as constant
EXACT = 1e-6  # of the outcomes' standard deviation: a residual is not scaled by less


@dataclass(frozen=True)
class LearntOptions:
    """kind: vhgp or gp. inducing: number of inducing inputs, None for a dense model. mean: what it is learnt about."""

    kind: str
    kernels: KernelChoice = DEFAULT_CHOICE
    inducing: int | None = None
    mean: MeanChoice = "zero"


def train_learnt(
    rows: PushTable, of_mean: PushTable, rig: Rig, options: LearntOptions, watch: Watch
) -> GaussianProcessPredictor:
    """The predictor trained on the rows; of_mean: those of them that the mechanics are fitted to.

    With the mean `auto`, the one of both whose held-out pushes are more likely. Raises TrainingError for outcomes that
    do not vary, and for options that the kind does not have.
    """
    found = []
    if options.mean != "mechanics":
        found.append(_trained(rows, rig, options, None, watch))
    if options.mean != "zero":
        watch(f"train {options.kind}: mechanics as mean", 0.0)
        found.append(_trained(rows, rig, options, fitted_mean(of_mean, rig), watch))
    best = max(found, key=lambda trained: trained.score).predictor
    watch(f"train {options.kind}: correlation of the outputs", 0.9)
    return replace(best, correlation=fit_correlation(best, rows.push_id))


@dataclass(frozen=True, eq=False)
class FittedMean:
    """Mechanics as mean, and the number of parameters that the rows determine."""

    mean: MechanicsMean
    count: float


def fitted_mean(rows: PushTable, rig: Rig) -> FittedMean:
    """All parameters of the mechanics that velocity, contact and angle show, fitted jointly under their priors.

    Those that need a covariate stay at their textbook values, so that a push needs nothing else than before.
    """
    support = None if rig.support_points is None else supported_at(rig.support_points)
    mechanics, known = PushMechanics(rig.outline, rig.pusher_radius, support), fit_rows(rows)
    names = [name for name in candidates(mechanics, known) if not BY_NAME[name].needs]
    fit = fit_jointly(mechanics, known, names)
    travel = float(np.mean(rows.inputs[:, 0] * rows.duration))
    return FittedMean(
        MechanicsMean(FittedMechanics(mechanics, fit.values, fit.covariance), travel), fit.effective_parameters
    )


@dataclass(frozen=True, eq=False)
class _Trained:
    """A predictor with the log density (nats, SI units) of its held-out training pushes, less what was fitted."""

    predictor: GaussianProcessPredictor
    score: float


def _trained(rows: PushTable, rig: Rig, options: LearntOptions, about: FittedMean | None, watch: Watch) -> _Trained:
    push = Push(rows.inputs, rows.duration, rows.covariates)
    targets = rows.outcomes if about is None else about.mean.residuals(push, rows.outcomes)
    scaling = _scaling(rows, rig, targets, centred=about is None)
    features, scaled = scaling.features(rig.outline, rows.inputs), scaling.outcomes(targets)
    block = np.asarray(np.unique(rows.push_id, return_inverse=True)[1] % MOST_BLOCKS, dtype=np.int64)
    regressions: list[Regression] = []
    for output, column in zip(OUTPUTS, scaled.T, strict=True):
        watch(f"train {options.kind}: {output}", 0.3 * len(regressions))
        regressions.append(_regression(features, column, options, None if about is None else block))
    predictor = GaussianProcessPredictor(rig, scaling, tuple(regressions), mean=None if about is None else about.mean)
    if options.mean != "auto":
        return _Trained(predictor, 0.0)
    score = sum(held_out_score(r, block) for r in regressions) - len(rows) * float(np.log(scaling.outcome_sd).sum())
    if about is not None:
        score -= about.count + len(OUTPUTS) * float(np.log(about.mean.size(push)).sum())
    return _Trained(predictor, score)


def _regression(features: Array, column: Array, options: LearntOptions, block: IntArray | None) -> Regression:
    """The regression of an output; of residuals (with block, the push of each row) only if it is worth it."""
    learnt = _learnt(features, column, options)
    if block is None:
        return learnt
    return best_held_out([fit_constant(features, column, heavy_tails=options.kind != "gp"), learnt], block)


def _learnt(features: Array, column: Array, options: LearntOptions) -> Regression:
    if options.kind == "gp":
        return fit_gp(features, column, options.kernels)
    if options.inducing is None:
        return fit_vhgp(features, column, options.kernels)
    if options.kernels != DEFAULT_CHOICE:
        raise TrainingError(f"{options.kernels}: a sparse VHGP has squared exponential kernels and no nugget")
    return fit_sparse_vhgp(features, column, options.inducing)


def _scaling(rows: PushTable, rig: Rig, targets: Array, *, centred: bool) -> Scaling:
    """centred: whether the mean of the targets (n, 3) is subtracted; a residual has mean zero."""
    features = push_features(rig.outline, rows.inputs)
    spread = np.ptp(features, axis=0)
    columns = np.flatnonzero(spread > CONSTANT * (1.0 + np.abs(features).max(axis=0)))
    for name, sd in zip(OUTPUTS, rows.outcomes.std(axis=0), strict=True):
        if not sd > 0.0:
            raise TrainingError(
                f"{name}: does not vary over the {len(rows)} training windows: there is nothing to learn"
            )
    if not columns.size:
        raise TrainingError(
            "velocity, contact and angle are the same in all training windows: there is nothing to learn"
        )
    used = features[:, columns]
    if centred:
        mean, sd = targets.mean(axis=0), targets.std(axis=0)
    else:
        mean, sd = np.zeros(len(OUTPUTS)), np.sqrt(np.mean(targets**2, axis=0)) + EXACT * rows.outcomes.std(axis=0)
    return Scaling(tuple(int(c) for c in columns), used.mean(axis=0), used.std(axis=0), mean, sd)
