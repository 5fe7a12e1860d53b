"""The tables of a trace's report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.evaluation.report.tables import metrics_tables
from push_predictor.evaluation.validation import metrics_json
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting import html
from push_predictor.residuals.outcome import FoundEffect, Gain, Sized, Tested, Trace
from push_predictor.residuals.reporting.figures.tested import best_of, role_of
from push_predictor.residuals.reporting.summary import comparisons_of
from push_predictor.residuals.reporting.wording import (
    SHOWN,
    driver_words,
    mechanism_words,
    p_words,
    shift_sizes,
    unit_of,
)

AT_ONCE = 15  # candidates shown without unfolding
ANGLES = ("angle", "slider_heading", "push_heading")


def effects_table(trace: Trace) -> str:
    """What was found, strongest first."""
    rows = [_effect_row(effect, trace.verdict == "variance") for effect in trace.effects]
    head = ("mechanism", "driver", "form", "parameter", "value", "unit", "outputs", "share of residual", "p")
    caption = (
        "What was found, strongest first. In brackets: 95 % intervals. Share: of the residual's sum of squares on the "
        "analysis pushes, in units of the prediction. p: family-wise over all that was tried."
    )
    return html.table(caption, head, rows)


def shifts_table(trace: Trace) -> str:
    """By how much each effect moves the outcome."""
    rows = []
    for effect, term in zip(trace.effects, trace.terms, strict=False):
        sizes = shift_sizes(trace, term, trace.analysis)
        name = f"{mechanism_words(effect.mechanism)}, {driver_words(effect.covariate)}"
        rows.append([name, *(_sized_cell(size) for size in sizes)])
    head = ("effect", "dx (mm)", "dy (mm)", "dtheta (deg)")
    caption = (
        "Root mean square shift of a window's outcome by each effect over the analysis pushes; 95 % intervals from the "
        "coefficients' covariance, which allows for what neighbouring pushes share."
    )
    return html.table(caption, head, rows)


def tested_tables(trace: Trace) -> list[str]:
    """All that was tried, smallest p first; what is beyond the first lines unfolds."""
    best = best_of(trace.tested)
    rows = [[mechanism_words(t.mechanism), t.covariate, p_words(t.p_value), _mark(trace, t)] for t in best]
    head = ("mechanism", "driver", "family-wise p", "")
    open_rows = max(AT_ONCE, 1 + max((k for k, row in enumerate(rows) if row[3]), default=0))
    caption = f"The {min(open_rows, len(rows))} candidates with the smallest p of {len(rows)}."
    parts = [html.table(caption, head, rows[:open_rows])]
    if rest := rows[open_rows:]:
        table = html.table(f"The other {len(rest)}.", head, rest)
        parts.append(html.details(f"The other {len(rest)} candidates", table))
    return parts


def held_out_tables(trace: Trace) -> list[str]:
    """NMSE, NLPD, exact density and coverage before, after the refit and with the effects, and the gain."""
    shown = comparisons_of(trace)
    metrics = [metrics_json(comparison) for comparison in shown]
    alike = len({comparison.push_id.tobytes() for comparison in shown}) == 1
    tables = (
        metrics_tables(shown, metrics)
        if alike
        else [table for c, m in zip(shown, metrics, strict=True) for table in metrics_tables([c], [m])]
    )
    return [*tables, gain_table(trace)] if trace.terms else tables


def gain_table(trace: Trace) -> str:
    """After minus refit."""
    rows = [
        ["total NMSE", _interval_cell(trace.gain_nmse)],
        ["total NLPD (nats per window)", _interval_cell(trace.gain_nlpd)],
    ]
    caption = (
        "The gain: after minus refit on the same held-out pushes, below zero is better. 95 % intervals by drawing "
        "whole pushes in pairs. The refit, not the deployed model, is the fair reference: it saw the new pushes too."
    )
    return html.table(caption, ("", "after minus refit"), rows)


def detectable_table(trace: Trace) -> str:
    """The smallest effects that would have been found."""
    keys = list(dict.fromkeys(key for size in trace.minimum_detectable.values() for key in size))
    named = [key for key in keys if key not in ("value", "unit")]
    rows = [
        [mechanism_words(name), *_size_cells(size), *(_told(size.get(key)) for key in named)]
        for name, size in trace.minimum_detectable.items()
    ]
    caption = "The smallest effect of each mechanism that would have been found on these pushes at this level."
    return html.table(caption, ("mechanism", "size", "unit", *(key.replace("_", " ") for key in named)), rows)


def experiment_table(trace: Trace) -> str:
    """Pushes that would separate the rivals."""
    keys = list(dict.fromkeys(key for push in trace.experiment for key in push))
    rows = [
        [str(k + 1), *(_told(_shown(key, push.get(key))) for key in keys)] for k, push in enumerate(trace.experiment)
    ]
    head = ("push", *(f"{key} ({unit})" if (unit := _unit(key)) else key for key in keys))
    return html.table("Pushes that would separate the rivals.", head, rows)


def _effect_row(effect: FoundEffect, scatter: bool) -> list[str]:
    size = effect.parameter
    share = effect.share_of_residual
    return [
        "scatter" if scatter else mechanism_words(effect.mechanism),
        effect.covariate,
        effect.basis,
        html.NOTHING if size is None else size.name,
        html.NOTHING if size is None else _interval_cell(Gain(*_scaled(size))),
        html.NOTHING if size is None else SHOWN.get(size.unit, (1.0, size.unit))[1],
        ", ".join(name for name in OUTPUTS if name in effect.outputs) or html.NOTHING,
        f"{100.0 * share:.1f} %" if np.isfinite(share) and share > 0.0 else html.NOTHING,
        p_words(effect.p_value),
    ]


def _scaled(size: Sized) -> tuple[float, float, float]:
    factor = SHOWN.get(size.unit, (1.0, size.unit))[0]
    return factor * size.value, factor * size.low, factor * size.high


def _sized_cell(size: Sized) -> str:
    return _interval_cell(Gain(*_scaled(size)))


def _interval_cell(gain: Gain) -> str:
    value, low, high = (html.number(v if np.isfinite(v) else None, 3) for v in (gain.value, gain.low, gain.high))
    return value if html.NOTHING in (low, high) else f"{value}\n[{low}, {high}]"


def _size_cells(size: Mapping[str, Any]) -> list[str]:
    value, unit = size.get("value"), str(size.get("unit", ""))
    factor, shown = SHOWN.get(unit, (1.0, unit))
    return [_told(value if value is None else factor * float(value)), shown]


def _mark(trace: Trace, tested: Tested) -> str:
    role = role_of(trace, tested)
    if role:
        return role
    return "p below alpha" if tested.p_value <= trace.alpha else ""


def _told(value: object) -> str:
    if value is None:
        return html.NOTHING
    if isinstance(value, int | float | np.floating):
        return html.number(float(value), 3) if np.isfinite(value) else html.NOTHING
    return str(value)


def _shown(key: str, value: float | None) -> float | None:
    return float(np.degrees(value)) if value is not None and key in ANGLES else value


def _unit(key: str) -> str:
    return "deg" if key in ANGLES else unit_of(key)
