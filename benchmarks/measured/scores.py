# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Train and score a model, and format its row: shared by the tables of benchmarks.measured."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation import push_scores as scores
from push_predictor.evaluation.estimate import Estimate, by_push, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.metrics import COVERAGE_LEVELS
from push_predictor.evaluation.push_scores import PushScores
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray

HEAD = "NMSE (dx dy dtheta) | 95 % of NMSE | NLPD | 95 % of NLPD | exact NLPD | within 95 % (dx dy dtheta)"
PLAIN = TrainingOptions(mean="zero", per_path=False, tails=False)  # as in Bauza and Rodriguez 2017
WITHIN = COVERAGE_LEVELS.index(0.95)


@dataclass(frozen=True, eq=False)
class Fold:
    """A model, its predictions of n test windows, which of them (n,) lie in its domain, and CPU s of training."""

    model: PushModel
    comparison: Comparison
    in_domain: BoolArray
    cpu: float

    @property
    def push_scores(self) -> PushScores:
        """The scores by push."""
        return scores.push_scores(self.comparison)


def trained(table: PushTable, test: PushTable, rig: Rig, kind: str, options: TrainingOptions = PLAIN) -> Fold:
    """Train on one table and predict another."""
    start = time.process_time()
    model = train_model(table, rig, kind, name=kind, options=options)
    cpu = time.process_time() - start
    in_domain = model.predict_rows(test.inputs, test.duration, test.covariates).in_domain
    return Fold(model, compare(model, test), in_domain, cpu)


def pooled(folds: Sequence[Fold]) -> PushScores:
    """Scores of all folds together; the NMSE of each fold refers to its own training mean."""
    return scores.pooled([fold.push_scores for fold in folds])


def figures(push_scores: PushScores) -> str:
    """The cells under HEAD: totals over the outputs in SI units, intervals by resampling whole pushes."""
    totals = push_scores.totals()
    nmse, nlpd = by_push(push_scores, total_nmse), by_push(push_scores, total_nlpd)
    exact = "" if _gaussian(push_scores) else f"{total(push_scores, 'exact_nlpd'):.2f}"
    cells: tuple[str, ...] = (f"{nmse.value:.3f} ({_listed(totals.nmse[0], '.3f')})", _between(nmse, ".2f"))
    cells += (f"{nlpd.value:.2f}", _between(nlpd, ".2f"), exact, within(push_scores))
    return " | ".join(cells)


def difference(first: PushScores, second: PushScores) -> str:
    """The cells under HEAD for the paired differences of the second model from the first, on the same rows."""
    nmse, nlpd = (difference_by_push(first, second, figure) for figure in (total_nmse, total_nlpd))
    exact = "" if _gaussian(second) else f"{total(second, 'exact_nlpd') - total(first, 'nlpd'):+.2f}"
    return f"{nmse.value:+.3f} | {_between(nmse, '+.3f')} | {nlpd.value:+.2f} | {_between(nlpd, '+.2f')} | {exact} |"


def within(push_scores: PushScores) -> str:
    """Share of the outcomes within the 95 % intervals, by output."""
    return _listed(push_scores.totals().coverage[0, :, WITHIN], ".2f")


def total(push_scores: PushScores, key: str) -> float:
    """One figure (nmse, nlpd, exact_nlpd), summed over the outputs."""
    return float(np.sum(getattr(push_scores.totals(), key)))


def _gaussian(push_scores: PushScores) -> bool:
    return np.array_equal(push_scores.exact_nlpd, push_scores.nlpd)


def _listed(values: Array, form: str) -> str:
    return " ".join(format(value, form) for value in values.tolist())


def _between(estimate: Estimate, form: str) -> str:
    return f"{estimate.low:{form}} to {estimate.high:{form}}"
