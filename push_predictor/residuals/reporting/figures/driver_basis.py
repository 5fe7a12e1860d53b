# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An effect as fitted against its covariate, with its band, and the data that it rests on: partial residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.push_scores import by_push
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect, design_of
from push_predictor.models.effects.exact import JointEffects, joint_shift
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.chart import HALF, WIDE, Band, Bars, Cells, Chart, Dots, Line, Mark, limits_of
from push_predictor.reporting.html import number
from push_predictor.residuals.channels.contrast import estimate_with_draws
from push_predictor.residuals.evidence.standardised import evidence_of, mechanics_under
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.pushes import (
    LEAST_PUSHES,
    Axis,
    Bins,
    axis_of,
    bins_along,
    push_means,
    titles,
)
from push_predictor.residuals.reporting.phrases import capitalised, shown_unit, with_unit
from push_predictor.types import Array, BoolArray, IntArray

GRID = 400
PUSHES_PER_BIN = 12
FEWEST_BINS, MOST_BINS = 3, 12
MAP_CELLS = 16
WIDEST = 8.0  # median widths of an interval that is shown; a bin of pushes that all stick has a far wider one
ROOM = 0.35  # of the range of curve and bins, above and below them
PERIODIC = ("periodic", "periodic, twice around")
CENTRAL = 1.96  # standard deviations that cover 95 % of a Gaussian


@dataclass(frozen=True, eq=False)
class Seen:
    """Rows along an axis: names, positions (k,) and parameters (k, q) of the pushes, and the bins."""

    axis: Axis
    names: list[str]
    place: Array
    value: Array
    bins: Bins


def basis_charts(trace: Trace, strength: Strength, rows: Rows) -> list[Chart]:
    """A chart for each parameter of the effect: the fit, single pushes and bins, along its covariate or the time."""
    every = range(len(strength.names))
    if len(strength.effect.basis.drivers) > 1:
        return [_map_chart(trace, strength, rows, q) for q in every]
    seen = _seen(trace, strength, rows)
    return [_chart(strength, rows.table, seen, q) for q in every]


def bins_of(basis: DriverBasis, table: PushTable) -> IntArray:
    """Bin (n,) of each window: levels, equal widths of a heading, else equal counts."""
    count = int(np.clip(len(table.pushes) // PUSHES_PER_BIN, FEWEST_BINS, MOST_BINS))
    if basis.name == "category":
        return np.asarray(np.searchsorted(np.sort(basis.levels), table.covariates[basis.drivers[0]]), dtype=np.int64)
    if basis.name in PERIODIC:
        values = table.covariates[basis.drivers[0]]
        return np.asarray(np.clip((values + np.pi) / (2.0 * np.pi) * count, 0, count - 1), dtype=np.int64)
    return bins_along(_axis(basis, table).x, count)


def parameter_label(strength: Strength, q: int) -> str:
    """A parameter with its unit, for an axis."""
    _, unit = shown_unit(strength.units[q])
    name = capitalised(strength.names[q])
    return f"{name} ({unit})" if unit else name


def _seen(trace: Trace, strength: Strength, rows: Rows) -> Seen:
    axis, response = _axis(strength.effect.basis, rows.table), responses(trace, strength, rows)
    place, value = per_push(strength, rows, response, axis.x)
    names = push_means(rows.table.push_id, axis.x)[0]
    bins = binned(strength, rows, response, axis.x, bins_of(strength.effect.basis, rows.table))
    return Seen(axis, names, place, value, bins)


def _axis(basis: DriverBasis, table: PushTable) -> Axis:
    return axis_of(table, basis.drivers[0] if basis.drivers else "")


def _chart(strength: Strength, table: PushTable, seen: Seen, q: int) -> Chart:
    factor, unit = shown_unit(strength.units[q])
    fit, limits = _fit(strength, table, seen.axis, q, factor)
    single = factor * seen.value[:, q]
    bars = _bars(seen.bins, q, factor, unit)
    low, high = limits_of(*limits, bars.low, bars.high, np.zeros(1), margin=ROOM)
    x = limits_of(seen.axis.x, margin=0.3 if seen.axis.whole else 0.02)
    zero = Line("zero", np.array(x), np.zeros(2))
    dots = Dots("push", seen.place, single, titles(seen.names, single, unit), name="one push")
    label = parameter_label(strength, q)
    return Chart(
        f"{label}, fitted and measured.", seen.axis.label, label, x, (low, high), (zero, *fit, dots, bars),
        names=seen.axis.names, size=WIDE if len(strength.names) == 1 else HALF,
    )  # fmt: skip


def _fit(strength: Strength, table: PushTable, axis: Axis, q: int, factor: float) -> tuple[list[Mark], list[Array]]:
    """The fitted curve with its band, and their values."""
    basis = strength.effect.basis
    if basis.name == "category":
        points = np.array(basis.levels)
    elif basis.name in PERIODIC:
        points = np.linspace(-np.pi, np.pi, GRID)
    else:
        values = table.covariates[basis.drivers[0]] if basis.drivers else np.zeros(1)
        points = np.linspace(values.min(), values.max(), GRID)
    mean, half = (factor * each[:, q] for each in strength.curve(dict.fromkeys(basis.drivers, points), len(points)))
    varies = np.ptp(points) > 0.0  # else along the time
    x = axis.factor * points if varies else np.linspace(axis.x.min(), axis.x.max(), GRID)
    name = "fitted, with 95 % interval"
    if basis.name == "category":
        shown = [f"fitted: {number(float(value), 3)}" for value in mean]
        return [Bars("after", x, mean, mean - half, mean + half, shown, name=name)], [mean - half, mean + half]
    return [Band("fit", x, mean - half, mean + half), Line("fit", x, mean, name=name)], [mean - half, mean + half]


def determined(width: Array) -> BoolArray:
    """Bins that determine the parameter: their interval is not far wider than most."""
    return np.asarray(width <= WIDEST * np.median(width)) if len(width) else np.zeros(0, dtype=np.bool_)


def _bars(bins: Bins, q: int, factor: float, unit: str) -> Bars:
    kept = determined(bins.high[:, q] - bins.low[:, q])
    each = (factor * ends[kept, q] for ends in (bins.value, bins.low, bins.high))
    return Bins(bins.place[kept], *each).bars("before", unit, "pushes, in bins")


def _map_chart(trace: Trace, strength: Strength, rows: Rows, q: int) -> Chart:
    """The fitted map, and on it each push in the colour of its own estimate."""
    factor, unit = shown_unit(strength.units[q])
    x, y = (rows.table.covariates[name] for name in strength.effect.basis.drivers)
    edges = [np.linspace(v.min(), v.max(), MAP_CELLS + 1) for v in (x, y)]
    gx, gy = np.meshgrid(*(0.5 * (e[1:] + e[:-1]) for e in edges))
    grid = dict(zip(strength.effect.basis.drivers, (gx.ravel(), gy.ravel()), strict=True))
    fitted = factor * strength.curve(grid, gx.size)[0][:, q].reshape(gx.shape)
    reach = max(float(np.abs(fitted).max()), 1e-12)
    shown = [[f"fitted: {number(float(value), 3)} {unit}".rstrip() for value in line] for line in fitted]
    names, place = push_means(rows.table.push_id, x)
    single = factor * per_push(strength, rows, responses(trace, strength, rows), x)[1][:, q]
    known = np.isfinite(single)
    kept = [name for name, is_known in zip(names, known, strict=True) if is_known]
    dots = (place[known], push_means(rows.table.push_id, y)[1][known], titles(kept, single[known], unit))
    cells = Cells("", edges[0], edges[1], fitted / reach, shown)
    first, second = (with_unit(name) for name in strength.effect.basis.drivers)
    across, up = ((float(e[0]), float(e[-1])) for e in edges)
    key = number(-reach, 2), number(reach, 2), parameter_label(strength, q)
    marks = cells, Dots("coloured", *dots, single[known] / reach)
    return Chart(f"Map of {key[2]}.", first, second, across, up, marks, size=(WIDE[0], 1.3 * WIDE[1]), key=key)


@dataclass(frozen=True, eq=False)
class Rows:
    """n windows, their standardised residuals (n, 3) after all effects, and the whitener (n, 3, 3)."""

    table: PushTable
    unexplained: Array
    whitener: Array


@dataclass(frozen=True, eq=False)
class Strength:
    """An effect of a known mechanism as q parameters that depend on its covariate.

    coefficients (q, m) and their covariance (q, m, m).
    """

    effect: Effect
    names: tuple[str, ...]
    units: tuple[str, ...]
    coefficients: Array
    covariance: Array

    def curve(self, covariates: Mapping[str, Array], n: int) -> tuple[Array, Array]:
        """Fitted parameters (n, q) and half of their 95 % band (n, q)."""
        values = self.effect.basis.values(covariates, n)
        variance = np.einsum("nm,qmk,nk->nq", values, self.covariance, values)
        return values @ self.coefficients.T, CENTRAL * np.sqrt(np.maximum(variance, 0.0))


def analysis_rows(trace: Trace) -> Rows:
    """Analysis pushes under the extended model, or under the deployed model minus the effects if there is none."""
    if trace.extended is not None:
        evidence = evidence_of(trace.extended, trace.analysis)
        return Rows(trace.analysis, evidence.z, evidence.whitener)
    evidence = evidence_of(trace.model, trace.analysis)
    shift = joint_shift(mechanics_under(trace.model), trace.terms, Push.of(trace.analysis))
    unexplained = replace(evidence, residual=evidence.residual - shift)
    return Rows(trace.analysis, unexplained.z, unexplained.whitener)


def strength_of(effect: Effect) -> Strength:
    """The effect's physical parameters."""
    parameters = mechanism_named(str(effect.mechanism)).parameters
    coefficients = effect.coefficients.reshape(len(parameters), -1)
    p, m = coefficients.shape
    blocks = effect.covariance.reshape(p, m, p, m)
    own = np.array([blocks[j, :, j] for j in range(p)])
    return Strength(effect, tuple(q.name for q in parameters), tuple(q.unit for q in parameters), coefficients, own)


def responses(trace: Trace, strength: Strength, rows: Rows) -> Array:
    """Standardised outcome (n, 3, q) per unit of each of the q parameters."""
    effect = strength.effect
    on, push = mechanics_under(trace.model), Push.of(rows.table)
    if effect.exact:
        bare = JointEffects.of([effect]).shifted(on, push)[1].transpose(0, 2, 1)
    else:
        bare = design_of(effect.mechanism, DriverBasis("constant"), on, push, effect.outcome_scale)
    return np.asarray(np.einsum("nij,njq->niq", rows.whitener, bare))


def binned(strength: Strength, rows: Rows, response: Array, place: Array, bins: IntArray) -> Bins:
    """The parameters in each bin (n,) of windows by least squares, with 95 % ends from a bootstrap of its pushes.

    place (n,): position of a window on the axis. Windows of bin -1 and bins of fewer than three pushes are dropped.
    """
    fitted = strength.curve(rows.table.covariates, len(rows.table))[0]
    target = rows.unexplained + np.einsum("nkq,nq->nk", response, fitted)
    found = [_of_bin(target, response, rows.table.push_id, place, bins == b) for b in np.unique(bins[bins >= 0])]
    kept = [each for each in found if each is not None]
    q = response.shape[2]
    stacked = np.array(kept).reshape(-1, 4, q)
    return Bins(stacked[:, 0, 0], stacked[:, 1], stacked[:, 2], stacked[:, 3])


def per_push(strength: Strength, rows: Rows, response: Array, place: Array) -> tuple[Array, Array]:
    """Position (k,) and parameters (k, q) of each push; NaN where the response is too small."""
    _, push = np.unique(rows.table.push_id, return_inverse=True)
    times = np.bincount(push)
    square = by_push(push, np.sum(response**2, axis=1))
    score = by_push(push, np.einsum("nkq,nk->nq", response, rows.unexplained))
    fitted = strength.curve(rows.table.covariates, len(rows.table))[0]
    mean = by_push(push, fitted) / times[:, None]
    informative = square >= 0.1 * np.median(square, axis=0)
    value = np.divide(score, square, out=np.full(score.shape, np.nan), where=informative & (square > 0.0)) + mean
    return np.bincount(push, place) / times, value


def _of_bin(target: Array, response: Array, push_id: np.ndarray, place: Array, rows: BoolArray) -> Array | None:
    names, push = np.unique(push_id[rows], return_inverse=True)
    if len(names) < LEAST_PUSHES or not np.any(response[rows]):
        return None
    nothing = np.empty((int(rows.sum()), 0))
    value, draws = estimate_with_draws(target[rows], response[rows], nothing, nothing, push)
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return np.stack([np.full(len(value), place[rows].mean()), value, low, high])
