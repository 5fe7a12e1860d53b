# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Observed against predicted outcomes, and residuals over time, which show a drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.push_scores import push_means
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.predictors.tails import half_widths
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.reporting.canvas import COLOURS, UNITS, grid, output_label
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class TimeAxis:
    """The time (n,) of each window, and the label of the axis."""

    place: Array
    label: str


def time_axis(comparison: Comparison, windows: Sequence[PushWindow] | None) -> TimeAxis:
    """Minutes since the first window if the windows are known, else the number of the push."""
    if windows:
        start = np.array([window.start for window in windows], dtype=np.int64)
        return TimeAxis((start - start.min()) / 60e9, "time since the first window (min)")
    number = {push: k for k, push in enumerate(dict.fromkeys(comparison.push_id.tolist()))}
    return TimeAxis(np.array([float(number[push]) for push in comparison.push_id.tolist()]), "push count")


def trend(place: Array, residual: Array, push_id: np.ndarray) -> Estimate | None:
    """Change of residuals (n,) over the whole time by a fitted line, with its interval from resampling pushes.

    None for fewer than three pushes or if all have the same time.
    """
    if len(set(push_id.tolist())) < 3 or not np.ptp(place) > 0.0:
        return None
    change = _change(np.ones((1, len(place))), place, residual)[0]
    draws = _change(push_bootstrap(push_id), place, residual)
    low, high = np.nanquantile(draws, [0.025, 0.975])
    return Estimate(float(change), float(low), float(high))


def paint_residuals(figure: Figure, comparison: Comparison, axis: TimeAxis) -> None:
    """Per output, top: observed against predicted; bottom: the standardised residual over time."""
    axes = figure.subplots(2, 3, height_ratios=(1.25, 1.0))
    residual, half = comparison.residuals, half_widths(comparison.tails, LEVEL)
    reach = max(3.0, float(np.percentile(np.abs(residual), 99.5)) * 1.1)
    for k in range(3):
        _paint_scatter(axes[0, k], comparison, k, half[k])
        axes[1, k].axhspan(-half[k], half[k], color="0.2", alpha=0.08, linewidth=0.0)
        _paint_over_time(axes[1, k], axis, residual[:, k], comparison.push_id, k, reach)
    axes[1, 0].set_ylabel("residual / predicted sd")
    axes[1, 1].set_xlabel(axis.label)


def _paint_scatter(ax: Axes, comparison: Comparison, k: int, half_width: float) -> None:
    predicted, observed = comparison.mean[:, k] * UNITS[k], comparison.observed[:, k] * UNITS[k]
    half = half_width * np.sqrt(comparison.variance[:, k]) * UNITS[k]
    both = np.concatenate([predicted, observed])
    margin = 0.05 * max(float(np.ptp(both)), 1e-9)
    ends = np.array([both.min() - margin, both.max() + margin])
    grid(ax)
    ax.vlines(predicted, predicted - half, predicted + half, color="0.6", alpha=0.35, linewidth=0.9)
    ax.plot(predicted, observed, "o", color=COLOURS[k], markersize=2.6, mew=0.0, alpha=0.75)
    ax.plot(ends, ends, color="0.2", linewidth=0.8, linestyle=":")
    ax.set(xlim=ends, ylim=ends, xlabel=f"predicted {output_label(k)}", ylabel=f"observed {output_label(k)}")
    ax.set_aspect("equal")
    ax.locator_params(nbins=6)


def _paint_over_time(ax: Axes, axis: TimeAxis, residual: Array, push_id: np.ndarray, k: int, reach: float) -> None:
    grid(ax)
    ax.axhline(0.0, color="0.2", linewidth=0.8, linestyle=":")
    ax.plot(axis.place, np.clip(residual, -reach, reach), "o", color="0.55", markersize=2.0, mew=0.0, alpha=0.7)
    place, mean = (push_means(push_id, values)[1] for values in (axis.place, residual))
    ax.plot(place, mean, "o", color=COLOURS[k], markersize=4.0, mew=0.0)
    found = trend(axis.place, residual, push_id)
    ax.set_title(_title(found), fontsize=8.0)
    ax.set_ylim(-1.05 * reach, 1.05 * reach)


def _title(found: Estimate | None) -> str:
    if found is None:
        return "too few pushes for a trend"
    return f"trend {found.value:+.2f} sd (95 % CI {found.low:+.2f} to {found.high:+.2f})".replace("-", "−")


def _change(weights: Array, place: Array, residual: Array) -> Array:
    """Slope times span, for weights (draws, n)."""
    total = weights.sum(axis=1)
    at, level = weights @ place / total, weights @ residual / total
    covariance = weights @ (place * residual) / total - at * level
    variance = weights @ place**2 / total - at**2
    slope = np.divide(covariance, variance, out=np.full(len(at), np.nan), where=variance > 1e-12 * np.ptp(place) ** 2)
    return np.asarray(slope * np.ptp(place))
