# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whether a model fits a recording: a sentence, a label of few words, and what to do.

The evidence is the alarm, the share of the outcomes that the predicted intervals contain, and the squared error against
that of mechanics with textbook parameters: a model that learnt from pushes and predicts worse learnt their faults.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_predictor.evaluation.metrics import nmse_reference
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.html import count

LEVEL = 0.95  # of the intervals that are judged
CLEARLY = 3.0  # standard errors: a share of outcomes by which intervals count as too narrow or too wide
FEWEST = 10  # pushes; with fewer a good score proves little, while a bad one may still be clear
TRACE = "Find the cause with `push_predictor trace`"


@dataclass(frozen=True)
class Judgement:
    """label: the judgement in few words; sentence: with its evidence; action: what to do."""

    label: str
    sentence: str
    action: str


def judged(metrics: Mapping[str, Any]) -> Judgement:
    """Judge a model by the JSON of `validate`, which has the alarm, of at least one push.

    n_training_pushes, if it is there: how many of the pushes were used for training.
    """
    alarm, share, pushes = metrics["alarm"], covered(metrics), int(metrics["n_pushes"])
    outcomes = f"the outcomes of {count(pushes, 'push', 'pushes')}"
    covers = f"95 % intervals cover {100.0 * share:.0f} % of {outcomes}"
    evidence = f"{covers}; {'no alarm' if 'off' not in alarm else 'no alarm was computed'}"
    if alarm["fired"]:
        action = f"{TRACE}, and do not rely on the predictions until then."
        return Judgement("no longer fits", f"The model no longer fits: the alarm fired; {covers}.", action)
    # Windows of one push resemble each other: the pushes count, not the windows.
    error = CLEARLY * np.sqrt(LEVEL * (1.0 - LEVEL) / pushes)
    if share < LEVEL - error:
        action = f"Do not rely on its intervals. {TRACE}, or train the model on such pushes."
        return Judgement("too sure", f"The model is too sure: {evidence}.", action)
    if metrics["nmse"]["total"] is not None and metrics["nmse"]["total"] >= len(OUTPUTS):
        reference = nmse_reference(int(metrics["n_train"]))
        sentence = f"The model predicts no better than {reference}; {evidence}."
        action = "Check slider, frames and units with `push_predictor check`, or train the model on such pushes."
        return Judgement("no better than the mean", sentence, action)
    if pushes < FEWEST:
        action = f"Record at least {FEWEST} pushes, then validate again."
        return Judgement("too few pushes", f"Too few pushes to judge the model: {evidence}.", action)
    if worse := _worse_than_textbook(metrics):
        action = "Check the recordings that it learnt from with `push_predictor check`, and this one."
        return Judgement("worse than physics", f"The model predicts worse than textbook physics: {worse}.", action)
    if 2 * int(metrics.get("n_training_pushes", 0)) >= pushes:
        action = "Validate it with a recording that was not used for training."
        return Judgement("fits its training", f"The model fits its own training pushes: {evidence}.", action)
    if "off" in alarm:
        action = "Use the model, but watch its errors: without the alarm a slow change stays unseen."
        return Judgement("no objection", f"Nothing speaks against the model: {evidence}.", action)
    return Judgement("fits", f"The model fits: {evidence}.", "Use the model for pushes like these.")


def _worse_than_textbook(metrics: Mapping[str, Any]) -> str:
    """The squared errors in words, if that of the model is clearly larger; else empty."""
    textbook = metrics.get("textbook")
    if textbook is None or not (textbook["difference"].get("low") or 0.0) > 0.0:
        return ""
    own, physics = metrics["nmse"]["total"], textbook["nmse"]["total"]
    return f"its squared error (total NMSE) is {own:.3g}, that of physics {physics:.3g}"


def covered(metrics: Mapping[str, Any]) -> float:
    """Share of the outcomes inside their intervals of LEVEL, the mean over the outputs."""
    return float(np.mean([metrics["coverage"][str(LEVEL)][name] for name in OUTPUTS]))
