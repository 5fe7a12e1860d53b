# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Windows and pushes along an axis: a covariate, or the time if there is none; and what hovering over them shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.push_scores import resampled_means
from push_predictor.recordings.table import INPUTS, PushTable
from push_predictor.reporting.chart import Bars
from push_predictor.reporting.html import number
from push_predictor.residuals.evidence.standardised import push_order
from push_predictor.residuals.reporting.phrases import covariate_phrase, interval, label, shown_unit_of
from push_predictor.types import Array, IntArray, TextArray

LEAST_PUSHES = 3  # of a bin that is shown
BINS, PUSHES_PER_BIN = 10, 4  # at most; about
GAP, WIDTH = 0.05, 0.03  # of the range: levels of a covariate are farther apart, and narrower


@dataclass(frozen=True, eq=False)
class Axis:
    """Position (n,) of each window, in shown units, with the label of the axis and names of places if it has any.

    factor: from the covariate's unit to the shown one.
    """

    x: Array
    label: str
    names: dict[float, str]
    factor: float = 1.0

    @property
    def whole(self) -> bool:
        """Whether the positions are a few named places."""
        return bool(self.names)


@dataclass(frozen=True, eq=False)
class Bins:
    """Places (b,) of bins along an axis; in each an estimate (b, ...) with 95 % ends from a bootstrap of pushes."""

    place: Array
    value: Array
    low: Array
    high: Array

    def bars(self, kind: str, unit: str, name: str) -> Bars:
        """The mark that shows one estimate for each bin; hovering shows it with its unit."""
        ends = zip(self.value, self.low, self.high, strict=True)
        shown = [interval(Estimate(*map(float, each)), unit) for each in ends]
        return Bars(kind, self.place, self.value, self.low, self.high, shown, name=name)


def axis_of(table: PushTable, covariate: str) -> Axis:
    """The covariate, or the time (else the push count) if it is not recorded or does not vary."""
    axis = recorded_axis(table, covariate)
    if axis is not None and np.ptp(axis.x) > 0.0:
        return axis
    return _order(table) if covariate == "elapsed_time" else axis_of(table, "elapsed_time")


def recorded_axis(table: PushTable, covariate: str) -> Axis | None:
    """A covariate or an input; None if there are no windows, or if they do not contain it."""
    values = table.inputs[:, INPUTS.index(covariate)] if covariate in INPUTS else table.covariates.get(covariate)
    if values is None or not len(values):
        return None
    names = {float(v): f"{v:g}" for v in np.unique(values)} if covariate in ("edge", "recording") else {}
    factor, unit = shown_unit_of(covariate)
    name = label(covariate_phrase(covariate))
    return Axis(factor * values, f"{name} ({unit})" if unit else name, names, factor)


def push_means(push_id: TextArray, values: Array) -> tuple[list[str], Array]:
    """The pushes, sorted by name, and the mean (k,) of their windows' values (n,)."""
    names, push = np.unique(push_id, return_inverse=True)
    return names.tolist(), np.bincount(push, values) / np.bincount(push)


def titles(names: Sequence[str], values: Array, unit: str = "") -> list[str]:
    """What hovering over each push shows."""
    return [f"push {name}: {number(float(v), 3)} {unit}".rstrip() for name, v in zip(names, values, strict=True)]


def bins_along(values: Array, count: int) -> IntArray:
    """Bin (n,) of each value: the levels of a covariate that has few, else equal counts."""
    ordered = np.sort(values)
    reach = float(np.ptp(ordered)) if len(ordered) else 0.0
    ends = np.flatnonzero(np.diff(ordered) > GAP * reach) + 1
    levels = np.split(ordered, ends)
    if len(levels) > 1 and max(float(np.ptp(level)) for level in levels) <= WIDTH * reach:
        edges = 0.5 * (ordered[ends - 1] + ordered[ends])
    else:
        edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1])) if reach else np.empty(0)
    return np.asarray(np.searchsorted(edges, values, side="right"), dtype=np.int64)


def means_along(axis: Axis, push_id: TextArray, values: Array, *, square: bool = False) -> Bins:
    """Means of values (n,) in bins of the axis; square: root mean squares instead."""
    count = int(np.clip(len(set(push_id.tolist())) // PUSHES_PER_BIN, 1, BINS))
    bins = np.unique(axis.x, return_inverse=True)[1] if axis.whole else bins_along(axis.x, count)
    found = [_mean(axis.x, push_id, values, bins == b, square) for b in np.unique(bins)]
    return Bins(*np.array([each for each in found if each is not None]).reshape(-1, 4).T)


def _mean(x: Array, push_id: TextArray, values: Array, rows: Array, square: bool) -> list[float] | None:
    if len(set(push_id[rows].tolist())) < LEAST_PUSHES:
        return None
    shown = values[rows] ** 2 if square else values[rows]
    low, high = np.quantile(resampled_means(push_id[rows], shown[:, None]), [0.025, 0.975])
    ends = np.array([shown.mean(), low, high])
    return [float(x[rows].mean()), *(np.sqrt(ends) if square else ends).tolist()]


def _order(table: PushTable) -> Axis:
    return Axis(push_order(table).astype(np.float64), "Push count", {})
