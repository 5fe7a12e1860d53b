# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sentences at the top of a validation report: judgement, error, action; calibration, comparison, use of training.

`validate` prints the first three as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor.evaluation.judgement import judged
from push_predictor.evaluation.metrics import nmse_reference
from push_predictor.evaluation.report.figures.calibration import NAMES
from push_predictor.evaluation.report.tables import interval_of, paired_difference
from push_predictor.evaluation.validation import Comparison, trained_on
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.html import count, number
from push_predictor.types import Array

LEVEL = 0.95


def opening_sentences(metrics: Mapping[str, Any]) -> tuple[str, str, str]:
    """Whether the model fits, how large its errors are, what to do; metrics: the JSON of `validate`, with the alarm."""
    found = judged(metrics)
    return found.sentence, error_sentence(metrics), found.action


def error_sentence(metrics: Mapping[str, Any]) -> str:
    """The total NMSE with its interval: the unexplained share of the variation, summed over the outputs."""
    total, interval = metrics["nmse"]["total"], metrics["interval"]["nmse"]
    if total is None:
        return "The outcomes do not vary, so the squared error has no scale (NMSE)."
    ends = "" if interval is None else f" (95 % CI {_rounded(interval['low'])} to {_rounded(interval['high'])})"
    reference = nmse_reference(metrics["n_train"])
    return f"Its squared error (total NMSE) is {_rounded(total)}{ends}, where 0 is perfect and 3 is {reference}."


def calibration_sentence(comparison: Comparison) -> str:
    """Whether the predicted 95 % intervals contain 95 % of the outcomes, by output."""
    inside = comparison.covered([LEVEL])[..., 0]
    shares = ", ".join(
        f"{100.0 * share:.0f} % of {name}" for name, share in zip(NAMES, inside.mean(axis=0), strict=True)
    )
    verdicts = _verdicts(interval_of(comparison, inside.astype(np.float64)))
    return f"Its 95 % intervals contain {shares}{verdicts}."


def comparison_sentence(main: Comparison, other: Comparison) -> str:
    """Which of two models has the better NLPD on the same windows, with the interval of the difference."""
    found = paired_difference(main, other)[1]
    value, low, high = found.value, found.low, found.high
    if not np.isfinite([low, high]).all():
        return f"{other.model}: its NLPD differs by {_rounded(value)} nats per window; one push gives no interval."
    if low <= 0.0 <= high:
        ends = f"{_rounded(value)} nats per window (95 % CI {_rounded(low)} to {_rounded(high)})"
        return f"{other.model} and {main.model} cannot be distinguished: the NLPD differs by {ends}."
    verdict, more = ("worse", "higher") if low > 0.0 else ("better", "lower")
    nearest, farthest = sorted((abs(low), abs(high)))
    ends = f"95 % CI {_rounded(nearest)} to {_rounded(farthest)}"
    return (
        f"{other.model} is {verdict} than {main.model}: "
        f"its NLPD is {_rounded(abs(value))} nats per window {more} ({ends})."
    )


def training_sentence(models: Sequence[PushModel], table: PushTable) -> tuple[str, bool]:
    """How many of the pushes were used for training, and whether any was."""
    used = {model.name: len(trained_on(model, table)) for model in models}
    pushes = count(len(table.pushes), "push", "pushes")
    if not any(used.values()):
        return "No push was used for training: whole pushes are held out.", False
    names = ", ".join(f"{n} for {name}" for name, n in used.items() if n)
    return f"Some of these {pushes} were used for training ({names}): the scores of these models are optimistic.", True


def _rounded(value: float) -> str:
    return number(value, 3, zeros=True)


def _listed(names: Sequence[str]) -> str:
    return " and ".join([*([", ".join(names[:-1])] if len(names) > 1 else []), names[-1]])


def _verdicts(ends: Array) -> str:
    """For each output that is miscalibrated beyond chance: too narrow or too wide; ends (2, 3)."""
    low, high = ends
    narrow = [name for name, end in zip(NAMES, high, strict=True) if end < LEVEL]
    wide = [name for name, end in zip(NAMES, low, strict=True) if end > LEVEL]
    found = (("too narrow", narrow), ("too wide", wide))
    if parts := [f"{verdict} for {_listed(names)}" for verdict, names in found if names]:
        return f": they are {' and '.join(parts)}"
    return ": no miscalibration beyond chance" if np.isfinite(ends).all() else ""
