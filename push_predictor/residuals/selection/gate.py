# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The gate: whether anything in the residuals is more than chance, judged over all candidates at once.

A learnt base saw few pushes, so its error is a function of its inputs even where nothing changed. An effect in these
inputs therefore counts only as the relation in the new data minus the relation in training, uncertain in both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from push_predictor.evaluation.metrics import whitener_of
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.push_model import PushModel
from push_predictor.residuals.candidates.candidate import Candidate, Nuisance, usable
from push_predictor.residuals.evidence.drivers import OF_SESSION
from push_predictor.residuals.evidence.input_shift import among
from push_predictor.residuals.evidence.inputs_basis import InputsBasis, Kind, inputs_basis
from push_predictor.residuals.evidence.loading import with_inputs
from push_predictor.residuals.evidence.residualizer import ResidualBlocks
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES, Evidence, whitened_response
from push_predictor.residuals.selection.screening import TINY, Columns, Scores, Screened, screen
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class Gate:
    """Screens candidates on residuals of these windows.

    inputs: the model's inputs, which are regressed out. baseline: cross-validated training residuals, against which
    effects in a learnt base's own inputs are judged.
    """

    evidence: Evidence
    candidates: tuple[Candidate, ...]
    inputs: InputsBasis
    alpha: float
    seed: int
    baseline: Baseline

    def screened(self, z: Array, noise: Array | None = None) -> Screened:
        """Statistic and family-wise p of all candidates on residuals z (n, 3); noise (n, 3): that of them, z if None.

        An effect that a fixed property of the rig may have caused in training, too, has the p of its difference.
        """
        seen = Seen(self.inputs, z, self.evidence.block, noise)
        each = [seen.scores(c, columns) for c, columns in zip(self.candidates, self._columns, strict=True)]
        return self._against_training(screen([self._unit(k, own) for k, own in enumerate(each)], self.seed), each)

    @cached_property
    def _columns(self) -> list[Columns]:
        """Those of all candidates, on any residuals."""
        seen = Seen(self.inputs, self.evidence.z, self.evidence.block)
        return [seen.columns(c) for c in self.candidates]

    @cached_property
    def _training(self) -> dict[int, tuple[Scores, Array]]:
        """Scores in training, by number of the candidates that are always judged against it."""
        return {k: self.baseline.scores(c) for k, c in enumerate(self.candidates) if self.baseline.judges(c)}

    def _unit(self, k: int, scores: Scores) -> Scores:
        """Scores of a candidate in units of chance, then of those in training (zero if it is not judged against it)."""
        if k in self._training:
            return difference((scores, self._columns[k].information), self._training[k])
        there = next((len(scores.rows) for scores, _ in self._training.values()), 0)
        return scores.turned(self._columns[k].unit).padded(there)

    def _against_training(self, screened: Screened, scores: Sequence[Scores]) -> Screened:
        """Raise p of effects of fixed rig properties to that of their difference from training, all at once."""
        baseline, candidates = self.baseline, self.candidates
        found = [k for k, c in enumerate(candidates) if screened.p_value[k] <= self.alpha and baseline.compares(c)]
        if not found:
            return screened
        information = [self._columns[k].information for k in found]
        changes = [
            difference((scores[k], own), baseline.scores(candidates[k]))
            for k, own in zip(found, information, strict=True)
        ]
        p_value = screened.p_value.copy()
        p_value[found] = np.maximum(p_value[found], screen(changes, self.seed).p_value)
        unchanged = tuple(k for k in found if p_value[k] > self.alpha)
        return replace(screened, p_value=p_value, unchanged=unchanged)


@dataclass(frozen=True, eq=False)
class Seen:
    """Residuals z (n, 3) as each candidate sees them: the controls of its kind and its nuisance regressed out.

    noise (n, 3): that of the residuals, z if None.
    """

    inputs: InputsBasis
    z: Array
    block: IntArray
    noise: Array | None = None

    def columns(self, c: Candidate) -> Columns:
        """Those of a candidate on these windows, without its controls."""
        return Columns(self.inputs.residualizers[c.kind](c.columns))

    def scores(self, c: Candidate, columns: Columns) -> Scores:
        """Block scores of a candidate."""
        key = c.kind, id(c.nuisance)  # many share one array of nuisance columns: each is projected off only once
        if key not in self._blocks:
            of_kind = self.inputs.residualizers[c.kind].blocks(self.z, self.block, self.noise)
            self._blocks[key] = of_kind.orthogonal_to(c.nuisance)
        return columns.scores(self._blocks[key])

    @cached_property
    def _blocks(self) -> dict[tuple[Kind, int], ResidualBlocks]:
        return {}


@dataclass(frozen=True, eq=False)
class Baseline:
    """Evidence of the training windows, each predicted without its push, and the basis of their inputs."""

    evidence: Evidence
    inputs: InputsBasis

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
        response = whitened_response(evidence, candidate.mechanism)
        in_training = replace(
            candidate,
            response=response,
            values=candidate.basis.values(evidence.table.covariates, len(response)),
            nuisance=self._nuisance.of_change(*candidate.label, candidate.basis, candidate.kind),
        )
        columns = self._seen.columns(in_training)
        return self._seen.scores(in_training, columns), columns.information

    @cached_property
    def _seen(self) -> Seen:
        return Seen(self.inputs, self.evidence.z, self.evidence.block)

    @cached_property
    def _known(self) -> dict[Candidate, tuple[Scores, Array]]:
        return {}

    @cached_property
    def _nuisance(self) -> Nuisance:
        mechanisms = [name for name in usable(self.evidence) if name is not None]
        return Nuisance(self.evidence, self.inputs, mechanisms, partial(whitened_response, self.evidence))


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
