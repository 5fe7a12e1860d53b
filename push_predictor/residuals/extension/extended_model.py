"""A model with the effects that were found: their size, their uncertainty, and the base that goes with them.

Coefficients by least squares in units of the base's prediction, all terms jointly. What a learnt base could say in its
own inputs goes out of residuals and responses first (Frisch and Waugh 1933), so that its having been trained on these
very pushes does not shrink an effect. Their covariance is a jackknife over blocks of pushes: it knows what neighbouring
pushes share, and what hangs on a few of them. The base is then trained anew on the outcomes less the effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from typing import TypeAlias

import numpy as np

from push_predictor import __version__
from push_predictor.evaluation.estimate import Figure, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.gaussian_process.kernels import KernelChoice
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import Cross
from push_predictor.models.push_model import (
    AnalyticalPredictor,
    ExtendedPredictor,
    GaussianProcessPredictor,
    Provenance,
    PushModel,
)
from push_predictor.models.train import TrainingOptions, train_model, training_rows
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.enumeration import candidate
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of, evidence_scale, physics_of
from push_predictor.residuals.outcome import Gain
from push_predictor.residuals.selection.cross_validation import RIDGE
from push_predictor.types import Array, IntArray

Term: TypeAlias = tuple[str | None, str, DriverBasis]  # mechanism (None: the generic one), covariate, form


def refit_base(model: PushModel, table: PushTable) -> PushModel:
    """The model as these pushes would have made it, in its own inputs alone: the fair reference of an extension.

    A learnt base is trained anew, by the kernels it has, on at most 1000 rows drawn evenly over the pushes; of an
    analytical one only the covariance is estimated anew. Effects that the model has already stay as they are.
    Raises TrainingError for too few rows.
    """
    predictor = model.predictor
    if not isinstance(predictor, ExtendedPredictor):
        return _retrained(model, table, table.outcomes)
    shift, _ = predictor.shift(_push(table))
    base = _retrained(model.base, table, table.outcomes - shift)
    return _wrapped(base, table, replace(predictor, base=_base_body(base)))


def extend(base: PushModel, table: PushTable, terms: Sequence[Term], deployed: PushModel | None = None) -> PushModel:
    """The base with these terms as effects, estimated on the pushes of a table that holds the covariates they need.

    deployed: a model that has not seen these pushes, whose residuals therefore hold the effects whole; those of a base
    that was trained on them, with the effects in its outcomes, do in part. The base if None. Raises TrainingError for
    too few rows.
    """
    known, learnt = deployed or base, base.kind != "analytical"
    physics, own_inputs = physics_of(known), inputs_basis(base, table).columns if learnt else None
    effects, cross = estimate(evidence_of(known, table, physics), terms, own_inputs)
    return _extended(base, table, effects, cross, physics)


def estimate(
    evidence: Evidence, terms: Sequence[Term], own_inputs: Array | None = None
) -> tuple[tuple[Effect, ...], Cross]:
    """The effects of these terms on the residuals, and what their coefficients share (see ExtendedPredictor).

    own_inputs (n, m): what goes out of residuals and responses first.
    """
    scale, designs = evidence_scale(evidence), [candidate(evidence, *term).columns for term in terms]
    columns, rest = np.concatenate(designs, axis=2), Residualizer(np.empty((len(evidence.table), 0)))
    if own_inputs is not None:
        rest = Residualizer(own_inputs)
    # Of all of a column, not of what is left of it: what the inputs explain away must not be blown up.
    ridge = RIDGE * np.sum(columns**2, axis=(0, 1)) + 1e-12
    coefficients, covariance = _least_squares(rest(columns), rest(evidence.z), evidence.block, ridge)
    covariance *= len(columns) / max(len(columns) - rest.q.shape[1], 1)
    ends = np.cumsum([0, *(design.shape[2] for design in designs)])
    parts = [slice(low, high) for low, high in pairwise(ends.tolist())]
    effects = tuple(
        Effect(mechanism, covariate, form, coefficients[part], covariance[part, part], scale)
        for (mechanism, covariate, form), part in zip(terms, parts, strict=True)
    )
    return effects, {(i, j): covariance[parts[i], parts[j]] for i, j in combinations(range(len(parts)), 2)}


def gain(
    refit: PushModel, after: PushModel, held_out: PushTable, training_mean: Array | None = None
) -> tuple[Gain, Gain]:
    """After minus refit in NMSE and in NLPD on held-out pushes, with the 95 % interval of a paired bootstrap by push.

    training_mean (3,): the reference of the NMSE; the refit's if None.
    """
    reference = refit.training_mean if training_mean is None else training_mean
    first, second = (push_scores(compared(model, held_out, reference)) for model in (refit, after))

    def difference(figure: Figure) -> Gain:
        return Gain(**vars(difference_by_push(first, second, figure)))

    return difference(total_nmse), difference(total_nlpd)


def compared(model: PushModel, table: PushTable, training_mean: Array) -> Comparison:
    """A model against a table, its NMSE over the distance from this mean outcome (3,)."""
    return replace(compare(model, table), training_mean=training_mean)


def _extended(
    base: PushModel, table: PushTable, effects: tuple[Effect, ...], cross: Cross, physics: AnalyticalPush
) -> PushModel:
    """The base with these effects beside those it has: a learnt one trained anew without them, the other rescaled."""
    predictor = _beside(base.predictor, physics, effects, cross)
    shift, _ = predictor.shift(_push(table))
    if base.kind != "analytical":
        trained = _retrained(base.base, table, table.outcomes - shift)
        return _wrapped(trained, table, replace(predictor, base=_base_body(trained)))
    mean, covariance, _ = predictor.base.moments(_push(table))
    left = table.outcomes - mean - shift
    scale = np.sqrt(np.mean(left**2, axis=0) / np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    return _wrapped(base, table, replace(predictor, scale=scale))


def _beside(
    predictor: GaussianProcessPredictor | AnalyticalPredictor | ExtendedPredictor,
    physics: AnalyticalPush,
    effects: tuple[Effect, ...],
    cross: Cross,
) -> ExtendedPredictor:
    """The base of a body with its effects and these behind them, unscaled."""
    if not isinstance(predictor, ExtendedPredictor):
        return ExtendedPredictor(predictor, physics, effects, np.ones(3), cross)
    had = len(predictor.effects)
    moved = {(had + i, had + j): shared for (i, j), shared in cross.items()}
    return ExtendedPredictor(
        predictor.base, physics, (*predictor.effects, *effects), np.ones(3), {**predictor.cross, **moved}
    )


def _base_body(model: PushModel) -> GaussianProcessPredictor | AnalyticalPredictor:
    return model.predictor.base if isinstance(model.predictor, ExtendedPredictor) else model.predictor


def _wrapped(base: PushModel, table: PushTable, predictor: ExtendedPredictor) -> PushModel:
    """A model of this body; its training rows are those of the table that the base was trained on, as observed."""
    return replace(base, predictor=predictor, training=_training(base, table), provenance=_provenance(base, table))


def _training(model: PushModel, table: PushTable) -> PushTable:
    return table if model.kind == "analytical" else table.take(training_rows(table, None, model.provenance.seed))


def _retrained(model: PushModel, table: PushTable, outcomes: Array) -> PushModel:
    rows, predictor, seed = replace(table, outcomes=outcomes), model.predictor, model.provenance.seed
    if isinstance(predictor, GaussianProcessPredictor):
        choice, sources = _choice(predictor), model.provenance.sources
        return train_model(
            rows,
            model.rig,
            model.kind,
            name=model.name,
            sources=sources,
            options=TrainingOptions(seed=seed, kernels=choice),
        )
    assert isinstance(predictor, AnalyticalPredictor)
    residual = outcomes - predictor.physics.displacement(table.inputs, table.duration)
    covariance = residual.T @ residual / len(residual)
    provenance = _provenance(model, table)
    return replace(model, predictor=replace(predictor, covariance=covariance), training=rows, provenance=provenance)


def _choice(predictor: GaussianProcessPredictor) -> KernelChoice:
    parameters = predictor.regressions[0].parameters
    return parameters.choice if isinstance(parameters, VhgpParameters) else KernelChoice(parameters.family)


def _provenance(model: PushModel, table: PushTable) -> Provenance:
    return Provenance(model.provenance.sources, len(table.pushes), model.provenance.seed, __version__)


def _least_squares(flat: Array, z: Array, block: IntArray, ridge: Array) -> tuple[Array, Array]:
    """Coefficients (p,) of columns (n, 3, p) for z (n, 3), and their covariance by leaving out block after block.

    ridge (p,): added to the columns' squares.
    """
    parts = [(flat[block == b].reshape(-1, flat.shape[2]), z[block == b].ravel()) for b in np.unique(block)]
    squares = np.stack([x.T @ x for x, _ in parts])
    targets = np.stack([x.T @ y for x, y in parts])
    square = squares.sum(axis=0) + np.diag(ridge)
    coefficients = np.linalg.solve(square, targets.sum(axis=0))
    scores = targets - squares @ coefficients
    away = np.linalg.solve(square - squares, scores[:, :, None])[:, :, 0]
    return coefficients, (1.0 - 1.0 / len(parts)) * away.T @ away


def _push(table: PushTable) -> Push:
    return Push(table.inputs, table.duration, table.covariates)
