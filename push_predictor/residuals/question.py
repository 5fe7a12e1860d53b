# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The question of a trace: the deployed model and the windows it is judged on, split once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.evaluation.validation import trained_on
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.drivers import LOCAL
from push_predictor.residuals.evidence.input_shift import ShiftedInput, about_mechanics, input_shift, widened
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.evidence.standardised import FEWEST_PUSHES, Evidence, evidence_of, held_out_rows
from push_predictor.types import BoolArray

# Of alpha, by channel: every kind of false alarm counts.
ALPHA_SHARES = {"measurement": 0.2, "motion": 0.45, "noise": 0.15, "force": 0.1, "zero": 0.1}


@dataclass(frozen=True, eq=False)
class Question:
    """Analysis pushes, their evidence, and held-out pushes.

    model: the deployed one, or one about mechanics where that cannot extrapolate. windows: of the analysis, as they
    were measured. inside: those among the inputs of training. trained: number of pushes that are not judged, because
    a learned model was trained on them.
    """

    deployed: PushModel
    model: PushModel
    loaded: LoadedData
    alpha: float
    covariates: tuple[str, ...] | None
    seed: int
    windows: PushTable
    evidence: Evidence
    inside: BoolArray
    held_out: PushTable
    shifted: tuple[ShiftedInput, ...]
    trained: int

    @classmethod
    def of(
        cls,
        model: PushModel,
        loaded: LoadedData,
        alpha: float = 0.01,
        covariates: Sequence[str] | None = None,
        seed: int = 0,
    ) -> Question:
        """Predict all windows and split them; covariates that only grow go on from the trace that extended the model.

        Raises as `trace`.
        """
        pushes = len(loaded.table.pushes)
        loaded = replace(loaded, table=unseen(model, loaded.table))
        _check(model, loaded.table, alpha, covariates)
        shift = input_shift(model, loaded.table)
        searched = about_mechanics(model) if shift.outside.any() else model
        table, held = loaded.table, held_out_rows(loaded.table)
        windows, own = table.take(~held), replace(shift, outside=shift.outside[~held])
        return cls(
            deployed=model,
            model=searched,
            loaded=loaded,
            alpha=alpha,
            covariates=None if covariates is None else tuple(covariates),
            seed=seed,
            windows=windows,
            evidence=widened(evidence_of(searched, windows), searched, own),
            inside=~own.outside,
            held_out=table.take(held),
            shifted=shift.inputs,
            trained=pushes - len(loaded.table.pushes),
        )

    def alpha_of(self, channel: str) -> float:
        """The part of alpha that a channel may spend."""
        return ALPHA_SHARES[channel] * self.alpha


def unseen(model: PushModel, table: PushTable) -> PushTable:
    """The windows of pushes that a learned model was not trained on; covariates that only grow go on from its trace.

    What was learnt fits its training pushes better than others, which would look like a change between recordings.
    """
    if not model.base.predictor.learnt:
        return model.continued(table)
    return model.continued(table.take(~np.isin(table.push_id, trained_on(model, table))))


def _check(model: PushModel, table: PushTable, alpha: float, covariates: Sequence[str] | None) -> None:
    if not 0.0 < alpha < 1.0:
        raise RequestError("alpha", alpha, "a probability above 0 and below 1")
    if not len(model.training):
        raise RequestError("model", model.name, "one that was trained on pushes: retrain it on those at hand")
    if len(table.pushes) < FEWEST_PUSHES:
        accepted = f"at least {FEWEST_PUSHES} that a learned model was not trained on, preferably hundreds"
        raise RequestError("pushes", len(table.pushes), accepted)
    for name in covariates or ():
        if name not in table.covariates or name in LOCAL:
            raise RequestError("covariate", name, f"one of {', '.join(sorted({*table.covariates} - {*LOCAL}))}")
