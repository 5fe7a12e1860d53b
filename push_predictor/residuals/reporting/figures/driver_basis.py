# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An effect as fitted against its covariate, with its band, and the data that it rests on: partial residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.estimate import NORMAL_95
from push_predictor.evaluation.push_scores import by_push, push_means
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect, design_of
from push_predictor.models.effects.exact import JointEffects, joint_shift
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.chart import HALF, WIDE, Band, Bars, Cells, Chart, Dots, Line, Mark, limits_of
from push_predictor.reporting.html import number
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of, mechanics_under
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.pushes import (
    Axis,
    axis_of,
    means_along,
    titles,
)
from push_predictor.residuals.reporting.phrases import capitalised, shown_unit
from push_predictor.types import Array

GRID = 400
MAP_CELLS = 16
ROOM = 0.35  # of the range of curve and bins, above and below them
PERIODIC = ("periodic", "periodic, twice around")


def basis_charts(trace: Trace, strength: Strength, rows: Evidence) -> list[Chart]:
    """A chart for each parameter of the effect: the fit, single pushes and bins, along its covariate or the time."""
    every = range(len(strength.names))
    if len(strength.effect.basis.drivers) > 1:
        return [_map_chart(trace, strength, rows, q) for q in every]
    axis = axis_of(rows.table, "".join(strength.effect.basis.drivers))
    value = per_push(strength, rows, responses(trace, strength, rows))
    return [_chart(strength, rows.table, axis, value[:, q], q) for q in every]


def parameter_label(strength: Strength, q: int) -> str:
    """A parameter with its unit, for an axis."""
    _, unit = shown_unit(strength.units[q])
    name = capitalised(strength.names[q])
    return f"{name} ({unit})" if unit else name


def _chart(strength: Strength, table: PushTable, axis: Axis, value: Array, q: int) -> Chart:
    """Value (k,): the parameter that each push shows."""
    factor, unit = shown_unit(strength.units[q])
    fit, limits = _fit(strength, table, axis, q, factor)
    names, place = push_means(table.push_id, axis.x)
    single, known = factor * value, np.isfinite(value)
    pushes = replace(axis, x=place[known])
    bars = means_along(pushes, np.array(names)[known], single[known]).bars("before", unit, "pushes, in bins")
    low, high = limits_of(*limits, bars.low, bars.high, np.zeros(1), margin=ROOM)
    x = limits_of(axis.x, margin=0.3 if axis.whole else 0.02)
    zero = Line("zero", np.array(x), np.zeros(2))
    dots = Dots("push", place, single, titles(names, single, unit), name="one push")
    label, size = parameter_label(strength, q), WIDE if len(strength.names) == 1 else HALF
    text, marks = f"{label}, fitted and measured.", (zero, *fit, dots, bars)
    return Chart(text, axis.label, label, x, (low, high), marks, names=axis.names, size=size)


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


def _map_chart(trace: Trace, strength: Strength, rows: Evidence, q: int) -> Chart:
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
    single = factor * per_push(strength, rows, responses(trace, strength, rows))[:, q]
    known = np.isfinite(single)
    kept = [name for name, is_known in zip(names, known, strict=True) if is_known]
    dots = (place[known], push_means(rows.table.push_id, y)[1][known], titles(kept, single[known], unit))
    cells = Cells("", edges[0], edges[1], fitted / reach, shown)
    first, second = (axis_of(rows.table, name).label for name in strength.effect.basis.drivers)
    across, up = ((float(e[0]), float(e[-1])) for e in edges)
    key = number(-reach, 2), number(reach, 2), parameter_label(strength, q)
    marks = cells, Dots("coloured", *dots, single[known] / reach)
    return Chart(f"Map of {key[2]}.", first, second, across, up, marks, size=(WIDE[0], 1.3 * WIDE[1]), key=key)


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
        return values @ self.coefficients.T, NORMAL_95 * np.sqrt(np.maximum(variance, 0.0))


def analysis_rows(trace: Trace) -> Evidence:
    """Analysis pushes under the extended model, or under the deployed model minus the effects if there is none."""
    if trace.extended is not None:
        return evidence_of(trace.extended, trace.analysis)
    evidence = evidence_of(trace.model, trace.analysis)
    return replace(evidence, residual=evidence.residual - joint_shift(evidence.mechanics, trace.terms, evidence.push))


def strength_of(effect: Effect) -> Strength:
    """The effect's physical parameters."""
    parameters = mechanism_named(str(effect.mechanism)).parameters
    coefficients = effect.coefficients.reshape(len(parameters), -1)
    p, m = coefficients.shape
    blocks = effect.covariance.reshape(p, m, p, m)
    own = np.array([blocks[j, :, j] for j in range(p)])
    return Strength(effect, tuple(q.name for q in parameters), tuple(q.unit for q in parameters), coefficients, own)


def responses(trace: Trace, strength: Strength, rows: Evidence) -> Array:
    """Standardised outcome (n, 3, q) per unit of each of the q parameters."""
    effect, push = strength.effect, rows.push
    on = mechanics_under(trace.model)
    if effect.exact:
        bare = JointEffects.of([effect]).shifted(on, push)[1].transpose(0, 2, 1)
    else:
        bare = design_of(effect.mechanism, DriverBasis("constant"), on, push, effect.outcome_scale)
    return np.asarray(np.einsum("nij,njq->niq", rows.whitener, bare))


def per_push(strength: Strength, rows: Evidence, response: Array) -> Array:
    """Parameters (k, q) that each push shows by itself; NaN where the response is too small."""
    _, push = np.unique(rows.table.push_id, return_inverse=True)
    square = by_push(push, np.sum(response**2, axis=1))
    score = by_push(push, np.einsum("nkq,nk->nq", response, rows.z))
    fitted = strength.curve(rows.table.covariates, len(rows.table))[0]
    mean = by_push(push, fitted) / np.bincount(push)[:, None]
    informative = square >= 0.1 * np.median(square, axis=0)
    own = np.divide(score, square, out=np.full(score.shape, np.nan), where=informative & (square > 0.0))
    return np.asarray(own + mean)
