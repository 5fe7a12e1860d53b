# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Cross-validated residuals of a base model on its training data: the reference for effects in its own inputs.

A learnt base saw few pushes, so its error is a function of its inputs even where nothing changed. An effect in these
inputs therefore counts only as the relation in the new data minus the relation in training, uncertain in both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import get_args

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.push_model import PushModel
from push_predictor.residuals.candidates.candidate import Candidate, Nuisance, usable
from push_predictor.residuals.evidence.drivers import OF_SESSION
from push_predictor.residuals.evidence.input_shift import among
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind, controls_for, inputs_basis
from push_predictor.residuals.evidence.loading import with_inputs
from push_predictor.residuals.evidence.residualizer import ResidualBlocks
from push_predictor.residuals.evidence.split import FEWEST_PUSHES
from push_predictor.residuals.evidence.standardised import Evidence, whitened_response, whitener_of
from push_predictor.residuals.selection.screening import TINY, Columns, Controlled, Scores, Screened, screen
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class Baseline:
    """Evidence of the training windows, each predicted without its push, and the basis of their inputs."""

    evidence: Evidence
    inputs: InputsBasis

    @property
    def deviation(self) -> Array:
        """Standard deviation (3,) of the standardised residuals; 1 for a calibrated model."""
        return np.asarray(self.evidence.z.std(axis=0))

    def judges(self, candidate: Candidate) -> bool:
        """Whether a candidate is always judged against training: it lies in the inputs of a learnt base."""
        if not self._records(candidate.basis):
            return False
        own = candidate.kind == "constant" or (candidate.kind == "speed" and self.inputs.knows_speed)
        return own and self.inputs.learnt

    def compares(self, candidate: Candidate) -> bool:
        """Whether a candidate may have acted in training too, because its covariate has a value there.

        A learnt base that folds sides or does not take the position as input lacks such an effect from the start.
        """
        return self.inputs.learnt and self.comparable(candidate.basis) and not self.judges(candidate)

    def comparable(self, basis: DriverBasis) -> bool:
        """Whether the covariates of a basis were recorded in training, and mean the same there.

        What is counted from the start of a session has another meaning in each.
        """
        return self._records(basis) and not set(basis.drivers) & set(OF_SESSION)

    def _records(self, basis: DriverBasis) -> bool:
        return all(name in self.evidence.table.covariates for name in basis.drivers)

    def scores(self, candidate: Candidate) -> tuple[Scores, Array]:
        """Block scores and information of a candidate on the training windows."""
        if candidate not in self._known:
            self._known[candidate] = self._scores(candidate)
        return self._known[candidate]

    def _scores(self, candidate: Candidate) -> tuple[Scores, Array]:
        evidence = self.evidence
        response = self._response(candidate.mechanism)
        in_training = replace(
            candidate,
            response=response,
            values=candidate.basis.values(evidence.table.covariates, len(response)),
            nuisance=self._nuisance.of_change(*candidate.label, candidate.basis, candidate.kind),
        )
        columns = Columns(self._seen[candidate.kind].residualizer(in_training.columns))
        return columns.scores(self._blocks(candidate.kind, in_training.nuisance)), columns.information

    def _blocks(self, kind: Kind, nuisance: Array | None) -> ResidualBlocks:
        """The residuals as a kind of candidate sees them; many candidates share one array of nuisance columns."""
        key = kind, id(nuisance)
        if key not in self._known_blocks:
            self._known_blocks[key] = self._seen[kind].blocks.orthogonal_to(nuisance)
        return self._known_blocks[key]

    @cached_property
    def _seen(self) -> dict[Kind, Controlled]:
        z, block = self.evidence.z, self.evidence.block
        return {kind: Controlled.of(z, controls_for(kind, self.inputs), block) for kind in get_args(Kind)}

    @cached_property
    def _known(self) -> dict[Candidate, tuple[Scores, Array]]:
        return {}

    @cached_property
    def _known_blocks(self) -> dict[tuple[Kind, int], ResidualBlocks]:
        return {}

    def _response(self, mechanism: str | None) -> Array:
        return whitened_response(self.evidence, mechanism)

    @cached_property
    def _nuisance(self) -> Nuisance:
        mechanisms = [name for name in usable(self.evidence) if name is not None]
        return Nuisance(self.evidence, self.inputs, mechanisms, self._response)


def baseline_of(model: PushModel, mechanics: FittedMechanics, inputs: Array | None = None) -> Baseline:
    """The baseline of a model, by leave-one-push-out predictions of the training windows that it keeps.

    inputs (n, 3): of the new windows. If these leave out a part of training's inputs, this part is not compared, as
    long as enough is left: the error of a learnt base depends on the inputs, and the sides of a slider differ.
    """
    table, predictor = with_inputs(model.training), model.predictor.with_independent_outputs()
    mean, covariance, _ = replace(model, predictor=predictor).held_out_moments()
    evidence = Evidence(table, table.outcomes - mean, whitener_of(covariance), mechanics)
    rows = np.ones(len(table), dtype=np.bool_) if inputs is None else among(table.inputs, inputs)
    if len(np.unique(table.push_id[rows])) < FEWEST_PUSHES:
        rows[:] = True
    return Baseline(evidence.take(rows), inputs_basis(model, table.take(rows)))


def raised(screened: Screened, changes: Mapping[int, Scores], seed: int) -> Screened:
    """Raise p of some candidates, by number, to that of their difference from training, judged all at once."""
    if not changes:
        return screened
    numbers, p_value = list(changes), screened.p_value.copy()
    p_value[numbers] = np.maximum(p_value[numbers], screen(list(changes.values()), seed).p_value)
    return replace(screened, p_value=p_value)


def difference(new: tuple[Scores, Array], training: tuple[Scores, Array]) -> Scores:
    """Scores of b + b' blocks for the relation in the new data minus that in training.

    new, training: block scores and information of the same columns in both.
    """
    (scores, information), (others, other) = new, training
    values, vectors = np.linalg.eigh(information + other)
    keep = vectors[:, values > TINY * max(values[-1], np.finfo(float).tiny)]
    ours, theirs = (np.linalg.inv(_lifted(keep.T @ a @ keep, information + other)) for a in (information, other))
    spread, axes = np.linalg.eigh(ours + theirs)
    root = axes / np.sqrt(spread)
    return scores.turned(keep @ ours @ root).stacked_on(others.turned(-keep @ theirs @ root))


def _lifted(information: Array, scale: Array) -> Array:
    """Information made positive definite; without information in training the difference stays undetermined."""
    return np.asarray(information + 1e-9 * np.trace(scale) / len(scale) * np.eye(len(information)))
