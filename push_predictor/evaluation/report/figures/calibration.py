# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Calibration: share of outcomes in the predicted intervals, and histograms of the PIT, both by push."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.evaluation.estimate import NORMAL_95
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison, pit
from push_predictor.reporting.canvas import COLOURS, SYMBOLS
from push_predictor.reporting.chart import Band, Chart, Line, Mark
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = ("Δx", "Δy", "Δθ")
KINDS = ("fit", "dy", "dtheta")  # colours of dx, dy, dtheta in charts
PERCENT = 100.0
LEVELS = np.linspace(0.02, 0.98, 49)
WINDOWS_PER_BAR = 10
FEWEST_BARS, MOST_BARS = 4, 10
DRAWS = 400


def coverage_chart(comparison: Comparison) -> Chart:
    """Observed against promised share for each output, in percent, with bands from resampling whole pushes."""
    levels = PERCENT * LEVELS
    share, low, high = (PERCENT * part for part in coverage_curve(comparison))
    bands: list[Mark] = [Band(kind, levels, low[:, k], high[:, k]) for k, kind in enumerate(KINDS)]
    lines = [Line(kind, levels, share[:, k], name=NAMES[k]) for k, kind in enumerate(KINDS)]
    ends = np.array([0.0, PERCENT])
    promised = Line("zero", ends, ends, name="as promised")
    label = f"Share of outcomes inside the predicted intervals of {comparison.model}, by their nominal share"
    limits = (0.0, PERCENT), (0.0, PERCENT)
    return Chart(label, "promised share (%)", "observed share (%)", *limits, (*bands, promised, *lines))


def paint_pit(figure: Figure, comparisons: Sequence[Comparison]) -> None:
    """A row per model: a histogram of the probability integral transform (PIT) per output."""
    axes = figure.subplots(len(comparisons), 3, squeeze=False)
    for row, comparison in zip(axes, comparisons, strict=True):
        values = pit(comparison)
        tallest = max(histogram(values[:, k])[0].max() for k in range(3))
        for k, ax in enumerate(row):
            _paint_pit(ax, values[:, k], comparison.push_id, k, tallest)
        row[0].set_ylabel(f"{comparison.model}\nwindows")
    for k, ax in enumerate(axes[0]):
        ax.set_title(f"PIT of {SYMBOLS[k]}")
    for ax in axes[-1]:
        ax.set_xlabel("predicted probability")


def coverage_curve(comparison: Comparison, levels: Array = LEVELS) -> tuple[Array, Array, Array]:
    """Observed share and the ends of its 95 % interval from resampling whole pushes, (levels, 3) each."""
    hit = np.swapaxes(comparison.covered(levels), 1, 2).astype(np.float64)
    weights = push_bootstrap(comparison.push_id, draws=DRAWS)
    draws = np.einsum("dn,nlk->dlk", weights, hit, optimize=True) / weights.sum(axis=1)[:, None, None]
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return hit.mean(axis=0), low, high


def histogram(values: Array) -> tuple[Array, Array]:
    """Counts (b,) and edges (b + 1,) of a histogram of probabilities, about ten windows a bar."""
    count = int(np.clip(len(values) // WINDOWS_PER_BAR, FEWEST_BARS, MOST_BARS))
    counts, edges = np.histogram(values, bins=count, range=(0.0, 1.0))
    return counts.astype(np.float64), edges


def expected_counts(values: Array, push_id: np.ndarray) -> tuple[float, float]:
    """Ends of the 95 % interval of a bar's count if the predicted probabilities hold; see `histogram`.

    Windows of a push are counted together, since they resemble each other: the variance of a count is the sum, over
    pushes, of the squared difference between a push's windows in the bar and its share, averaged over the bars.
    """
    bars = len(histogram(values)[0])
    push = np.unique(push_id, return_inverse=True)[1]
    bar = np.minimum((values * bars).astype(np.int64), bars - 1)
    found = np.bincount(push * bars + bar, minlength=bars * (int(push.max()) + 1)).reshape(-1, bars)
    away = found - found.mean(axis=1, keepdims=True)
    middle, half = len(values) / bars, NORMAL_95 * float(np.sqrt(np.sum(away**2) / bars))
    return max(middle - half, 0.0), middle + half


def _paint_pit(ax: Axes, values: Array, push_id: np.ndarray, output: int, tallest: float) -> None:
    counts, edges = histogram(values)
    low, high = expected_counts(values, push_id)
    look: dict[str, Any] = {"color": COLOURS[output], "alpha": 0.75, "edgecolor": "white", "linewidth": 0.6}
    ax.bar(edges[:-1], counts, np.diff(edges), align="edge", **look)
    ax.axhspan(low, high, color="0.2", alpha=0.18, linewidth=0.0)
    ax.axhline(len(values) / len(counts), color="0.2", linewidth=0.8, linestyle=":")
    ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.08 * max(tallest, high)), xticks=(0.0, 0.5, 1.0))
