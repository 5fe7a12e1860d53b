"""What a base model leaves over where it was trained: the reference for what lies in its own inputs.

A learnt base is wrong by a function of its inputs, because it saw few pushes; so an effect in these inputs counts only
as its relation to the residual in the new data less that in the training data, uncertain in both. The same goes for
covariates that share the tracker's noise with the residual.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.gaussian_process.cross_validation import moments_left_out
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import ExtendedPredictor, GaussianProcessPredictor, with_independent_outputs
from push_predictor.models.push_model import PushModel
from push_predictor.residuals.candidates.enumeration import Candidate, usable
from push_predictor.residuals.candidates.nuisance import Nuisance
from push_predictor.residuals.evidence.drivers import LOCAL, STANDING
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, inputs_basis, inputs_of
from push_predictor.residuals.evidence.loading import with_inputs
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import Evidence, push_order, whitened_response, whitener_of
from push_predictor.residuals.selection.screening import TINY, Scores, raw_scores
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class Baseline:
    """Evidence from the training windows, none of them judged by a model that saw its push; basis of their inputs."""

    evidence: Evidence
    basis: InputsBasis

    @property
    def deviation(self) -> Array:
        """Standard deviation (3,) of the residuals in units of the prediction: 1 for an honest model."""
        return np.asarray(self.evidence.z.std(axis=0))

    def applies(self, candidate: Candidate) -> bool:
        """Whether this candidate is judged against training: one in the base's own inputs, or one local to a push."""
        if any(name not in self.evidence.table.covariates for name in candidate.form.drivers):
            return False
        own = candidate.kind == "constant" or (candidate.kind == "speed" and self.basis.knows_speed)
        return (own and self.basis.learnt) or candidate.covariate in LOCAL

    def stands(self, candidate: Candidate) -> bool:
        """Whether what drives this candidate belongs to the rig and drove in training too, if it does at all.

        A learnt base that folds sides or knows no place lacks it then, but lacks it since it was trained.
        """
        recorded = all(name in self.evidence.table.covariates for name in candidate.form.drivers)
        return self.basis.learnt and recorded and candidate.covariate in STANDING and not self.applies(candidate)

    def scores(self, candidate: Candidate) -> tuple[Scores, Array]:
        """Block scores and information of a candidate on the training windows."""
        evidence = self.evidence
        response = self._response(candidate.mechanism)
        there = replace(
            candidate,
            response=response,
            values=candidate.form.values(evidence.table.covariates, len(response)),
            beside=self._nuisance.beside(*candidate.label, candidate.form, candidate.kind),
        )
        out = Residualizer(inputs_of(candidate.kind, self.basis))
        return raw_scores(out.left(evidence.z, evidence.block).apart(there.beside), out(there.columns))

    def _response(self, mechanism: str | None) -> Array:
        if mechanism not in self._responses:
            self._responses[mechanism] = whitened_response(self.evidence, mechanism)
        return self._responses[mechanism]

    @cached_property
    def _nuisance(self) -> Nuisance:
        mechanisms = [name for name in usable(self.evidence) if name is not None]
        return Nuisance(self.evidence, self.basis, mechanisms, self._response)

    @cached_property
    def _responses(self) -> dict[str | None, Array]:
        return {}


def baseline_of(model: PushModel, physics: AnalyticalPush) -> Baseline:
    """The baseline of a model, from the training windows that it keeps, each push left out of what it is judged by."""
    table, predictor = with_inputs(model.training), with_independent_outputs(model.predictor)
    push = Push(table.inputs, table.duration, table.covariates)
    base = predictor.base if isinstance(predictor, ExtendedPredictor) else predictor
    moments = (
        moments_left_out(base, push_order(table)) if isinstance(base, GaussianProcessPredictor) else base.moments(push)
    )
    mean, covariance, _ = predictor.extended(moments, push) if isinstance(predictor, ExtendedPredictor) else moments
    evidence = Evidence(table, table.outcomes - mean, whitener_of(covariance), physics)
    return Baseline(evidence, inputs_basis(model, table))


def difference(new: tuple[Scores, Array], training: tuple[Scores, Array]) -> Scores:
    """Scores of b + b' blocks of the relation in new data less that in training, as screening.screen takes them.

    new, training: block scores and information of the same columns in both.
    """
    (scores, information), (others, other) = new, training
    values, vectors = np.linalg.eigh(information + other)
    keep = vectors[:, values > TINY * max(values[-1], np.finfo(float).tiny)]
    ours, theirs = (np.linalg.inv(_lifted(keep.T @ a @ keep, information + other)) for a in (information, other))
    spread, axes = np.linalg.eigh(ours + theirs)
    root = axes / np.sqrt(spread)
    return scores.turned(keep @ ours @ root).beside(others.turned(-keep @ theirs @ root))


def _lifted(information: Array, scale: Array) -> Array:
    """Information that is nowhere zero: where training says nothing, no difference can be told."""
    return np.asarray(information + 1e-9 * np.trace(scale) / len(scale) * np.eye(len(information)))
