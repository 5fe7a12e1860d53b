# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of a validation report: the numbers of `metrics_json` with 95 % intervals from resampling whole pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor.evaluation.estimate import Estimate, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.metrics import COVERAGE_LEVELS, joint_nlpd, nmse_reference
from push_predictor.evaluation.push_scores import push_scores, resampled_means
from push_predictor.evaluation.validation import Comparison
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting import html
from push_predictor.types import Array

MILLIMETRES = 2.0 * np.log(1000.0)  # added to the total NLPD when dx and dy are in mm
Metrics = Mapping[str, Any]
COLUMNS = (*OUTPUTS, "total")


def metrics_tables(comparisons: Sequence[Comparison], metrics: Sequence[Metrics]) -> list[str]:
    """HTML tables of the metrics_json of these comparisons; the others are compared with the first."""
    pairs = list(zip(comparisons, metrics, strict=True))
    tables = [_error_table(pairs), _density_table(pairs), _coverage_table(pairs)]
    if len(pairs) > 1 and len(comparisons[0].observed):
        tables.append(_difference_table(comparisons))
    return tables


def paired_difference(main: Comparison, other: Comparison) -> tuple[Estimate, Estimate]:
    """Total NMSE and total NLPD of `other` minus those of `main`, with 95 % intervals.

    Both comparisons contain the same windows, so the difficulty of a push cancels. Low and high are NaN for fewer than
    two pushes.
    """
    scores = push_scores(main), push_scores(other)
    return difference_by_push(*scores, total_nmse), difference_by_push(*scores, total_nlpd)


def interval_of(c: Comparison, values: Array) -> Array:
    """Ends (2, k) of the 95 % intervals of the means of values (n, k) of its windows; NaN for fewer than two pushes."""
    return _ends(resampled_means(c.push_id, values))


def _error_table(pairs: Sequence[tuple[Comparison, Metrics]]) -> str:
    rows = []
    for c, m in pairs:
        counts = [str(m[name]) for name in ("n_train", "n_test", "n_pushes")]
        rows.append(
            [
                c.model,
                *counts,
                *_cells([m["nmse"][name] for name in COLUMNS], _with_total(push_scores(c).resampled().nmse)),
            ]
        )
    reference = nmse_reference(max(c.n_train for c, _ in pairs))
    caption = (
        f"Normalised mean squared error (NMSE) per output: 0 is perfect, 1 is no better than {reference}. "
        "The total is the sum over the outputs. In brackets, in all tables: 95 % intervals from resampling pushes."
    )
    return html.folded_table(caption, ("model", "training windows", "windows", "pushes", *COLUMNS), rows)


def _density_table(pairs: Sequence[tuple[Comparison, Metrics]]) -> str:
    rows = []
    for c, m in pairs:
        joint = resampled_means(c.push_id, joint_nlpd(c.mean, c.covariance, c.observed)[:, None])
        values = [*(m["nlpd"][name] for name in COLUMNS), m["joint_nlpd"]]
        draws = np.column_stack([_with_total(push_scores(c).resampled().nlpd), joint])
        rows.append([c.model, *_cells(values, draws)])
        if m["exact_nlpd"] is not None:
            draws = _with_total(push_scores(c).resampled().exact_nlpd)
            own = _cells([m["exact_nlpd"][name] for name in COLUMNS], draws)
            rows.append([f"{c.model}, own density", *own, html.NOTHING])
    caption = (
        "Negative log predictive density (NLPD) of the predicted Gaussian, nats per window in SI units. Lower "
        f"is better. In mm and rad, total and joint are {MILLIMETRES:.4f} higher. Joint: with the full covariance. "
        "Own density: the predictive density of a model for which this is no Gaussian."
    )
    return html.folded_table(caption, ("model", *COLUMNS, "joint"), rows)


def _coverage_table(pairs: Sequence[tuple[Comparison, Metrics]]) -> str:
    head = ("model, output", *(f"{100.0 * level:.0f} % interval" for level in COVERAGE_LEVELS))
    rows = []
    for c, m in pairs:
        covered = push_scores(c).resampled().coverage
        levels = [m["coverage"][str(level)] or dict.fromkeys(OUTPUTS) for level in COVERAGE_LEVELS]
        for k, name in enumerate(OUTPUTS):
            rows.append([f"{c.model}, {name}", *_cells([found[name] for found in levels], covered[:, k], digits=3)])
        draws = resampled_means(c.push_id, c.joint_covered(COVERAGE_LEVELS).astype(np.float64))
        rows.append([f"{c.model}, joint", *_cells(list(m["joint_coverage"].values()), draws, digits=3)])
    caption = (
        "Coverage: share of outcomes inside the predicted central interval; joint: inside the region of the three "
        "outputs. Below the nominal share the intervals are "
        "too narrow, above it too wide."
    )
    return html.folded_table(caption, head, rows)


def _difference_table(comparisons: Sequence[Comparison]) -> str:
    main, *others = comparisons
    rows = [[c.model, *(_cell(e.value, (e.low, e.high)) for e in paired_difference(main, c))] for c in others]
    caption = (
        f"Each model minus {main.model}, on the same windows. Above zero, {main.model} is better. "
        f"An interval that contains zero shows no significant difference."
    )
    return html.folded_table(caption, ("model", "total NMSE", "total NLPD (nats)"), rows)


def _with_total(draws: Array) -> Array:
    """Draws (d, 3) of the outputs, and of their sum."""
    return np.column_stack([draws, draws.sum(axis=1)])


def _ends(draws: Array) -> Array:
    """Ends (2, k) of the central 95 % of draws (draws, k), NaN without draws."""
    if not len(draws) or np.isnan(draws).any(axis=0).all():
        return np.full((2, draws.shape[1]), np.nan)
    return np.asarray(np.quantile(draws, [0.025, 0.975], axis=0))


def _cells(values: Sequence[float | None], draws: Array, digits: int = 4) -> list[str]:
    low, high = _ends(draws)
    return [_cell(value, ends, digits) for value, ends in zip(values, zip(low, high, strict=True), strict=True)]


def _cell(value: float | None, ends: tuple[float, float], digits: int = 4) -> str:
    """A number and, on a second line, its interval if there is one."""
    shown = html.number(value, digits, zeros=True)
    if value is None or not np.all(np.isfinite(ends)):
        return shown
    low, high = (html.number(end, digits - 1, zeros=True) for end in ends)
    return f"{shown}\n[{low}, {high}]"
