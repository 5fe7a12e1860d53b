# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The models of a Tuesday after its first pushes, scored on later pushes that none of them has learned from.

deployed: Monday's model. adapted: updated push by push; headed: the same with the mechanisms in the world among those
that may change. retrained: refitted to these pushes in its inputs (`refit_base`). extended: by a `trace` of the most
pushes. oracle: the deployed model with the true mechanism and driver, its size fitted to all of Tuesday.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from benchmarks.adaptation.rigs import KINDS, WEAR
from push_predictor.adaptation import Adaptation
from push_predictor.adaptation.adaptation import USUAL
from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.push_scores import PushScores, push_scores
from push_predictor.evaluation.validation import comparison_of_moments
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.extension.extended_model import refit_base
from push_predictor.residuals.trace import trace

SEEN = (0, 10, 30, 100)  # pushes since the change
NEXT = 20  # pushes after those seen: the test after a change that grows
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

    @cached_property
    def seen(self) -> tuple[int, ...]:
        """Numbers of pushes after which models are judged: SEEN, as far as there are pushes, or every one of a few."""
        count = len(self.pushes)
        return tuple(seen for seen in SEEN if seen < count) if count > SEEN[1] else tuple(range(count))

    def between(self, first: int, last: int) -> PushTable:
        """The windows of the pushes with these numbers."""
        return self.loaded.table.take(np.isin(self.loaded.table.push_id, self.pushes[first:last]))

    def tested(self, seen: int) -> PushTable:
        """The pushes on which a model that has seen so many is judged: the same for all, but after one that grows."""
        if self.change == WEAR:
            return self.between(seen, seen + NEXT)
        return self.between(self.seen[-1], len(self.pushes))

    def scores(self, model: PushModel, table: PushTable) -> PushScores:
        """Of a model on a table; the NMSE is relative to the mean of the deployed model's training."""
        found = model.predict_rows(table.inputs, table.duration, table.covariates)
        comparison = comparison_of_moments(model, table, found.mean, found.covariance)
        exact = model.exact_log_density(table)
        return push_scores(replace(comparison, exact_log_density=exact, training_mean=self.model.training_mean))


@dataclass(frozen=True, eq=False)
class Scored:
    """Scores of a method after so many pushes, and on each of the first before it was seen; CPU s per update."""

    after: dict[int, PushScores]
    running: PushScores
    seconds: tuple[float, ...] = ()


def deployed(tuesday: Tuesday) -> Scored:
    """The model as it is."""
    return _steady(tuesday, tuesday.model)


def oracle(tuesday: Tuesday) -> Scored:
    """With the effect that acts, if any is known."""
    if (kind := KINDS.get(tuesday.change)) is None:
        return deployed(tuesday)
    evidence, driver, basis = evidence_of(tuesday.model, tuesday.loaded.table), "constant", DriverBasis("constant")
    if tuesday.change == WEAR:
        scale = float(evidence.table.covariates[SLID].std())
        driver, basis = SLID, DriverBasis("linear", (SLID,), (0.0,), (scale,))
    effects, cross = estimated(fitted(FitRows(evidence), [candidate(evidence, kind, driver, basis)]), of_size=True)
    predictor = ExtendedPredictor(tuesday.model.predictor.base, effects, np.ones(3), cross)
    return _steady(tuesday, replace(tuesday.model, predictor=predictor))


def retrained(tuesday: Tuesday) -> Scored:
    """Refitted to the pushes so far."""
    return _learning(tuesday, lambda seen: refit_base(tuesday.model, tuesday.between(0, seen)), tuesday.seen[1:])


def extended(tuesday: Tuesday) -> Scored:
    """The model that `trace` extends, the deployed one where it refuses."""
    seen, model = tuesday.seen[-1:], tuesday.model
    known = replace(tuesday.loaded, table=tuesday.between(0, seen[0]), recordings=None)
    return _learning(tuesday, lambda _: trace(model, known).extended or model, seen)


def adapted(tuesday: Tuesday, mechanisms: Sequence[str] = USUAL) -> Scored:
    """Updated with the windows of every push."""
    adaptation = Adaptation(tuesday.model, mechanisms)
    after, running, seconds = {}, [], []
    for number in range(tuesday.seen[-1] + 1):
        now, windows = adaptation.adapted, tuesday.between(number, number + 1)
        if number in tuesday.seen:
            after[number] = tuesday.scores(now, tuesday.tested(number))
        if number < tuesday.seen[-1]:
            running.append(tuesday.scores(now, windows))
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


def joined(parts: Sequence[PushScores]) -> PushScores:
    """The scores of different pushes as one."""
    return PushScores(
        *(np.concatenate(columns) for columns in zip(*(vars(part).values() for part in parts), strict=True))
    )


def _steady(tuesday: Tuesday, model: PushModel) -> Scored:
    """Scores of a model that does not learn."""
    after = {seen: tuesday.scores(model, tuesday.tested(seen)) for seen in tuesday.seen}
    return Scored(after, tuesday.scores(model, tuesday.between(0, tuesday.seen[-1])))


def _learning(tuesday: Tuesday, learn: Callable[[int], PushModel], sizes: Sequence[int]) -> Scored:
    """Scores of models that learn at these numbers of pushes, and until then are the deployed one."""
    after, running, begin, model = {}, [], 0, tuesday.model
    for seen in sizes:
        running.append(tuesday.scores(model, tuesday.between(begin, seen)))
        with suppress(PushPredictorError):  # too few pushes
            model = learn(seen)
        after[seen], begin = tuesday.scores(model, tuesday.tested(seen)), seen
    return Scored(after, joined(running))
