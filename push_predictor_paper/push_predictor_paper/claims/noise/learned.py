# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Size and range of the noise that VHGPs learn from simulated and from measured pushes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from push_predictor.recordings.table import OUTPUTS
from push_predictor.types import Array
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.estimate import Estimate, over_seeds
from push_predictor_paper.fits.map_models import ModelMap, square_maps
from push_predictor_paper.section import Table
from push_predictor_paper.statistics.noise_figures import HIGH, LOW, span_of
from push_predictor_paper.study import Study

HEAD = ("output", "RMS ratio", "median of sd over |mean|", "within 10 to 40 %", "95th over 5th percentile of the sd")
NAMES = ("dx", "dy", "rotation")


def learned_parts(study: Study) -> tuple[list[Table], list[str], dict[str, Any]]:
    """A table for each corpus with a square pushed at about 20 mm/s, a note for any other, and the numbers."""
    tables, notes, data = [], [], {}
    for corpus in study.corpora:
        models = square_maps(study, corpus)
        if not models:
            notes.append(f"{corpus.title}: no windows of a square at about 20 mm/s, so its noise cannot be learned.")
            continue
        figures = [learned_figures(models, k) for k in range(len(OUTPUTS))]
        rows = [
            (name, *(e.cell(f) for e, f in zip(row, FORMS, strict=True)))
            for name, row in zip(NAMES, figures, strict=True)
        ]
        tables.append(Table(_caption(study, corpus), HEAD, tuple(rows)))
        data[corpus.title] = {
            name: dict(zip(KEYS, (e.json() for e in row), strict=True))
            for name, row in zip(OUTPUTS, figures, strict=True)
        }
    return tables, notes, data


FORMS = (".0%", ".0%", ".0%", ".1f")
KEYS = ("rms_ratio", "median_ratio", "within_10_to_40", "p95_over_p5")


def learned_figures(models: Sequence[ModelMap], k: int) -> tuple[Estimate, ...]:
    """RMS ratio, median ratio, share within 10 to 40 % and range of output k, over the models."""
    known = [np.isfinite(model.mean[..., k]) for model in models]
    parts = [(m.mean[at][:, k], m.process_sd[at][:, k]) for m, at in zip(models, known, strict=True)]
    figures = np.array([_figures(np.abs(mean), sd) for mean, sd in parts])
    return tuple(over_seeds(column.tolist()) for column in figures.T)


def _figures(mean: Array, sd: Array) -> tuple[float, float, float, float]:
    ratio = sd / mean
    within = float(np.mean((ratio >= LOW) & (ratio <= HIGH)))
    return float(np.sqrt(np.mean(sd**2) / np.mean(mean**2))), float(np.median(ratio)), within, span_of(sd)


def _caption(study: Study, corpus: Corpus) -> str:
    shape, surface = corpus.reference
    windows = min(study.plan.size, len(corpus.sets[corpus.reference].table))
    return (
        f"The process noise learned from {shape} on {surface}. {corpus.title}. VHGPs of {windows} training windows, "
        "evaluated at 20 mm/s for 61 angles (±86°) and 41 contacts, within the training data; mean over "
        f"{study.plan.seeds} draws of training windows with Student's interval. The paper: 10 to 40 %, up to an "
        "order of magnitude."
    )
