# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of the mean standardised residual over contact point and push angle, before and after, on one colour scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.report.maps import Cells, PushMap, coarse_cells, contact_label, recorded_map
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.covariates import CUMULATIVE
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.reporting import chart, html
from push_predictor.reporting.chart import Chart
from push_predictor.reporting.html import number
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.driver_basis import Strength, strength_of
from push_predictor.residuals.reporting.phrases import bare, count, covariate_phrase, place_of_step
from push_predictor.types import Array, BoolArray

LEAST_REACH = 1.0  # predicted standard deviations at either end of the colours; less is noise of few windows
WIDEST = 97.0  # % of the cells whose values the colours resolve
NARROW = (215.0, 195.0)  # pixels of a panel if there are more than three in a row
LEAST_HALF = 24  # windows; fewer fill too few cells
LEAST_CELLS = 4  # of a map that is worth a picture
MEANING = "mean residual / predicted standard deviation"


@dataclass(frozen=True, eq=False)
class Column:
    """A column of the picture: standardised residuals z (n, 3) of the windows of a table."""

    title: str
    part: str
    table: PushTable
    z: Array


@dataclass(frozen=True, eq=False)
class Halves:
    """Windows (n,) split by the strength of an effect, with the names of both parts; one part if it is constant."""

    masks: tuple[BoolArray, ...]
    names: tuple[str, ...]


def map_figures(trace: Trace) -> list[str]:
    """Maps of the held-out pushes: on those of the analysis a smaller residual would be no proof."""
    columns = _columns(trace)
    shown = map_charts(trace.model.rig.outline, columns) if columns else []
    per_row = len(columns) if len(columns) > 1 else len(OUTPUTS)
    return [html.charts(shown, _map_caption(trace, columns), per_row)] if shown else []


def halves_of(strength: Strength | None, table: PushTable) -> Halves:
    """Windows before and after a step, else below and above the median of the fitted effect.

    One part if the effect is constant, or if either part has too few windows.
    """
    whole = Halves((np.ones(len(table), dtype=np.bool_),), ("",))
    if strength is None or not strength.effect.basis.drivers or not len(table):
        return whole
    basis = strength.effect.basis
    values = strength.curve(table.covariates, len(table))[0]
    widest = values[:, int(np.argmax(values.std(axis=0)))]
    place = basis.values(table.covariates, len(table))[:, 0] > 0.5 if basis.name == "step" else _above(widest)
    if min(int(place.sum()), int((~place).sum())) < LEAST_HALF:
        return whole
    return Halves((~place, place), _names(basis, place, table))


def columns_of(title: str, table: PushTable, z: Array, halves: Halves) -> list[Column]:
    """A column for each half."""
    return [
        Column(title, name, table.take(mask), z[mask]) for mask, name in zip(halves.masks, halves.names, strict=True)
    ]


def map_charts(outline: Outline, columns: Sequence[Column]) -> list[Chart]:
    """Rows dx, dy, dtheta, a column for each of `columns`; empty if there are too few windows."""
    cells = _cells(outline, columns)
    if np.prod(cells.shape) < LEAST_CELLS:
        return []
    maps = [recorded_map(outline, replace(c.table, outcomes=c.z), np.zeros_like(c.z), cells) for c in columns]
    if not any(np.isfinite(shown.mean).any() for shown in maps):
        return []
    reach = reach_of(maps)
    size = NARROW if len(columns) > 3 else chart.SMALL
    return [_panel(c, m, k, reach, size) for k in range(len(OUTPUTS)) for c, m in zip(columns, maps, strict=True)]


def reach_of(maps: Sequence[PushMap]) -> float:
    """The end of one colour scale for all, symmetric about zero."""
    known = np.abs(np.concatenate([m.mean[np.isfinite(m.mean)] for m in maps]))
    return max(LEAST_REACH, float(np.percentile(known, WIDEST))) if known.size else LEAST_REACH


def _panel(column: Column, shown: PushMap, k: int, reach: float, size: tuple[float, float]) -> Chart:
    contact, angle = 1e3 * shown.cells.contact, np.degrees(shown.cells.angle)
    values = shown.mean[..., k]
    title = f"{OUTPUTS[k]}, {column.title}"
    part = f"; {column.part}" if column.part else ""
    cells = chart.Cells("", contact, angle, values / reach, _titles(shown, values))
    ends = (float(contact[0]), float(contact[-1])), (float(angle[0]), float(angle[-1]))
    key = number(-reach, 2), number(reach, 2), MEANING
    return Chart(
        f"Map of the mean residual of {title}{part}.", "Contact (mm)", f"Angle (deg){part}", *ends, (cells,),
        title=title, size=size, key=key,
    )  # fmt: skip


def _titles(shown: PushMap, values: Array) -> list[list[str]]:
    pushes = np.zeros(values.shape, dtype=np.int64) if shown.pushes is None else shown.pushes
    return [
        [f"{count(int(pushes[r, c]), 'push', 'pushes')}: {number(float(values[r, c]), 2)}" for c in range(len(row))]
        for r, row in enumerate(values)
    ]


def _cells(outline: Outline, columns: Sequence[Column]) -> Cells:
    """Cells for the column with the fewest windows, over the angles of all."""
    fewest = min((column.table for column in columns), key=len)
    widest = max((column.table for column in columns), key=len)
    cells, angle = coarse_cells(outline, fewest), coarse_cells(outline, widest).angle
    return Cells(cells.contact, np.linspace(angle[0], angle[-1], len(cells.angle)))


def _above(values: Array) -> BoolArray:
    """Windows above the median, or above the middle of the range if few are: levels may repeat."""
    above = values > np.median(values)
    return above if above.mean() > 0.25 else values > 0.5 * (values.min() + values.max())


def _names(basis: DriverBasis, above: BoolArray, table: PushTable) -> tuple[str, str]:
    values = table.covariates[basis.drivers[0]]
    if basis.name == "step":
        place = place_of_step(basis.drivers[0], basis.place)
        first, second = ("until", "since") if basis.drivers[0] in CUMULATIVE else ("below", "above")
        return f"{first} {place}", f"{second} {place}"
    low, high = values[~above], values[above]
    if len(basis.drivers) == 1 and (low.max() <= high.min() or high.max() <= low.min()):
        phrase = bare(covariate_phrase(basis.drivers[0]))
        lower, upper = f"low {phrase}", f"high {phrase}"
        return (lower, upper) if low.max() <= high.min() else (upper, lower)
    return "weak effect", "strong effect"


def _columns(trace: Trace) -> list[Column]:
    table, shown = trace.held_out.table, trace.comparisons
    shown = shown[::2] if trace.verdict == "measurement" and len(shown) > 2 else shown[-2:]
    if not len(table) or any(len(comparison.observed) != len(table) for comparison in shown):
        return []
    halves = halves_of(strength_of(trace.terms[0], trace.analysis) if trace.terms else None, table)
    return [c for each in shown for c in columns_of(each.model, table, each.residuals, halves)]


def _map_caption(trace: Trace, columns: list[Column]) -> str:
    after = "the deployed model on windows cut again" if trace.verdict == "measurement" else "with the effects found"
    meaning = {"before": "the deployed model", "refit": "retrained on the analysis pushes", "after": after}
    models = [f"{name.capitalize()}: {meaning[name]}." for name in dict.fromkeys(column.title for column in columns)]
    return (
        f"Mean residual of {len(trace.held_out.table.pushes)} held-out pushes over contact point and push angle, in "
        f"units of the predicted standard deviation. {' '.join(models)}{_split_words(trace, columns)} Nothing was "
        f"fitted or chosen on these pushes. Up: push angle. Across: {contact_label(trace.model.rig.outline)}. Grey: "
        "fewer than six windows."
    )


def _split_words(trace: Trace, columns: list[Column]) -> str:
    """Why the maps are split, if they are."""
    if not any(column.part for column in columns):
        return ""
    where = "at the step" if trace.terms[0].basis.name == "step" else "at the median strength of the first effect"
    name = covariate_phrase(trace.terms[0].covariate)
    return f" Maps are split {where}: an effect that changes with {name} may cancel in one map of all pushes."
