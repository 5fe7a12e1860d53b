# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The models of a Tuesday after its first k pushes, each scored on later pushes that none has seen.

deployed: Monday's model. adapted: updated push by push; headed: the same with the mechanisms in the world among those
that may change. retrained: refitted to the k pushes in its inputs (`refit_base`). extended: by `trace` of the k pushes,
where it extends. oracle: the deployed model with the true mechanism and driver, its size fitted to all of Tuesday.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from benchmarks.adaptation.rigs import KINDS, NOTHING, WEAR
from push_predictor.adaptation import Adaptation
from push_predictor.adaptation.adaptation import USUAL
from push_predictor.evaluation.push_scores import PushScores, push_scores
from push_predictor.evaluation.validation import comparison_of_moments
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.evidence.drivers import standard_basis
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of
from push_predictor.residuals.extension.extended_model import refit_base
from push_predictor.residuals.trace import trace

SEEN = (0, 10, 30, 100)  # pushes since the change
NEXT = 20  # pushes after the k seen: the test after a change that grows; else all from SEEN[-1] on are, for every k
HEADED = (*USUAL, "anisotropic_friction", "tilted_surface")
SLID = "slid_distance"


@dataclass(frozen=True, eq=False)
class Tuesday:
    """A deployed model, and the windows of a recording after a change of this name."""

    model: PushModel
    change: str
    loaded: LoadedData

    @cached_property
    def pushes(self) -> list[str]:
        """In order of time."""
        return self.loaded.table.pushes

    def between(self, first: int, last: int) -> PushTable:
        """The windows of the pushes with these numbers."""
        return self.loaded.table.take(np.isin(self.loaded.table.push_id, self.pushes[first:last]))

    def tested(self, seen: int) -> PushTable:
        """The pushes on which a model that has seen so many is judged."""
        if self.change == WEAR:
            return self.between(seen, seen + NEXT)
        return self.between(SEEN[-1], len(self.pushes))


@dataclass(frozen=True, eq=False)
class Scored:
    """What a method scored: after so many pushes, and on each of the first SEEN[-1] before it was seen; CPU s per update.
    """

    after: dict[int, PushScores]
    running: PushScores
    seconds: tuple[float, ...] = ()


def scores(model: PushModel, table: PushTable, reference: PushModel) -> PushScores:
    """Of a model on a table; the NMSE is relative to the mean of the reference's training."""
    found = model.predict_rows(table.inputs, table.duration, table.covariates)
    comparison = comparison_of_moments(model, table, found.mean, found.covariance)
    exact = model.exact_log_density(table)
    return push_scores(replace(comparison, exact_log_density=exact, training_mean=reference.training_mean))


def deployed(tuesday: Tuesday) -> Scored:
    """The model as it is."""
    return _steady(tuesday, tuesday.model)


def oracle(tuesday: Tuesday) -> Scored:
    """The deployed model with the effect that acts, if any."""
    evidence = evidence_of(tuesday.model, tuesday.loaded.table)
    terms = true_terms(tuesday.change, evidence)
    if not terms:
        return deployed(tuesday)
    found = [_with_effect(tuesday.model, evidence, term) for term in terms]
    gained = [scores(model, tuesday.loaded.table, tuesday.model).exact_nlpd.sum() for model in found]
    return _steady(tuesday, found[int(np.argmin(gained))])


def retrained(tuesday: Tuesday) -> Scored:
    """Refitted to the pushes so far; until there are ten it is the deployed one."""
    return _known_at(tuesday, lambda seen: refit_base(tuesday.model, tuesday.between(0, seen)), SEEN[1:])


def extended(tuesday: Tuesday) -> Scored:
    """The model that `trace` extends, the deployed one where it refuses."""

    def traced(seen: int) -> PushModel:
        loaded = replace(tuesday.loaded, table=tuesday.between(0, seen), recordings=None)
        return trace(tuesday.model, loaded).extended or tuesday.model

    return _known_at(tuesday, traced, SEEN[-1:])


def adapted(tuesday: Tuesday, mechanisms: Sequence[str] = USUAL) -> Scored:
    """Updated with the windows of every push."""
    adaptation = Adaptation(tuesday.model, mechanisms)
    after, running, seconds = {}, [], []
    for number in range(SEEN[-1] + 1):
        now, windows = adaptation.adapted, tuesday.between(number, number + 1)
        if number in SEEN:
            after[number] = scores(now, tuesday.tested(number), tuesday.model)
        if number < SEEN[-1]:
            running.append(scores(now, windows, tuesday.model))
            begin = time.process_time()
            adaptation.update(windows)
            seconds.append(time.process_time() - begin)
    return Scored(after, joined(running), tuple(seconds))


METHODS: dict[str, Callable[[Tuesday], Scored]] = {
    "deployed": deployed,
    "oracle": oracle,
    "retrained": retrained,
    "extended": extended,
    "adapted": adapted,
    "headed": partial(adapted, mechanisms=HEADED),
}


def true_terms(change: str, evidence: Evidence) -> list[Candidate]:
    """The true mechanism with its driver; of wear along one of two measures that grow together, both."""
    if change == NOTHING:
        return []
    if change != WEAR:
        return [candidate(evidence, KINDS[change], "constant", DriverBasis("constant"))]
    slid = evidence.table.covariates[SLID]
    return [candidate(evidence, KINDS[change], SLID, replace(standard_basis("linear", SLID, slid), centre=(0.0,)))]


def joined(parts: Sequence[PushScores]) -> PushScores:
    """The scores of different pushes as one."""
    fields = PushScores.__dataclass_fields__
    return PushScores(*(np.concatenate([getattr(part, field) for part in parts]) for field in fields))


def _with_effect(model: PushModel, evidence: Evidence, term: Candidate) -> PushModel:
    effects, cross = estimated(fitted(FitRows(evidence), [term]), of_size=True)
    return replace(model, predictor=ExtendedPredictor(model.predictor.base, effects, np.ones(3), cross))


def _steady(tuesday: Tuesday, model: PushModel) -> Scored:
    """Scores of a model that does not learn."""
    after = {seen: scores(model, tuesday.tested(seen), tuesday.model) for seen in SEEN}
    return Scored(after, scores(model, tuesday.between(0, SEEN[-1]), tuesday.model))


def _known_at(tuesday: Tuesday, learn: Callable[[int], PushModel], sizes: Sequence[int]) -> Scored:
    """Scores of models that learn at these numbers of pushes; before the first, the deployed one predicts."""
    after, running, before = {}, [], (0, tuesday.model)
    for seen in sizes:
        running.append(scores(before[1], tuesday.between(before[0], seen), tuesday.model))
        before = seen, learn(seen)
        after[seen] = scores(before[1], tuesday.tested(seen), tuesday.model)
    return Scored(after, joined(running))
