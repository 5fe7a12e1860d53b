"""The refit: the same model trained on the new pushes, without the effects; the fair reference of an extension."""

from __future__ import annotations

from dataclasses import replace

from push_predictor import __version__
from push_predictor.models.gaussian_process.kernels import KernelChoice
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
from push_predictor.models.mechanisms import Push
from push_predictor.models.push_model import (
    AnalyticalPredictor,
    ExtendedPredictor,
    GaussianProcessPredictor,
    Provenance,
    PushModel,
)
from push_predictor.models.train import TrainingOptions, train_model, training_rows
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array


def refit_base(model: PushModel, table: PushTable) -> PushModel:
    """Refit a model to these pushes in its own inputs alone; effects that it already has stay as they are.

    A learnt base is retrained with its own kernels on at most 1000 rows, drawn evenly over the pushes. Of an analytical
    base only the covariance is estimated again. Raises TrainingError for too few rows.
    """
    predictor = model.predictor
    if not isinstance(predictor, ExtendedPredictor):
        return retrained(model, table, table.outcomes)
    shift, _ = predictor.shift(Push(table.inputs, table.duration, table.covariates))
    base = retrained(model.base, table, table.outcomes - shift)
    return with_predictor(base, table, replace(predictor, base=base_predictor(base)))


def retrained(model: PushModel, table: PushTable, outcomes: Array) -> PushModel:
    """A model without effects, trained again on the pushes of a table with these outcomes (n, 3)."""
    rows, predictor, seed = replace(table, outcomes=outcomes), model.predictor, model.provenance.seed
    if isinstance(predictor, GaussianProcessPredictor):
        options = TrainingOptions(seed=seed, kernels=_kernels(predictor))
        return train_model(
            rows, model.rig, model.kind, name=model.name, sources=model.provenance.sources, options=options
        )
    assert isinstance(predictor, AnalyticalPredictor)
    residual = outcomes - predictor.physics.displacement(table.inputs, table.duration)
    covariance = residual.T @ residual / len(residual)
    provenance = _provenance(model, table)
    return replace(model, predictor=replace(predictor, covariance=covariance), training=rows, provenance=provenance)


def with_predictor(base: PushModel, table: PushTable, predictor: ExtendedPredictor) -> PushModel:
    """The model of a predictor; its training rows are those that the base was trained on, as observed."""
    learnt = base.kind != "analytical"
    training = table.take(training_rows(table, None, base.provenance.seed)) if learnt else table
    return replace(base, predictor=predictor, training=training, provenance=_provenance(base, table))


def base_predictor(model: PushModel) -> GaussianProcessPredictor | AnalyticalPredictor:
    """The predictor of a model without its effects."""
    return model.predictor.base if isinstance(model.predictor, ExtendedPredictor) else model.predictor


def _kernels(predictor: GaussianProcessPredictor) -> KernelChoice:
    parameters = predictor.regressions[0].parameters
    return parameters.choice if isinstance(parameters, VhgpParameters) else KernelChoice(parameters.family)


def _provenance(model: PushModel, table: PushTable) -> Provenance:
    return Provenance(model.provenance.sources, len(table.pushes), model.provenance.seed, __version__)
