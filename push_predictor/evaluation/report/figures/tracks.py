# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whole pushes from above: the path of the slider's centre, and the prediction of each window."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.figures.ellipses import inside, paint_ellipse
from push_predictor.evaluation.validation import Comparison
from push_predictor.geometry.frames import rotate
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.reporting.canvas import OBSERVED, UNITS, grid, outside_legend
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 3
AROUND = 0.04


def chosen_pushes(windows: Sequence[PushWindow], count: int = MOST) -> list[list[int]]:
    """Rows of up to `count` long pushes, spread over the rotation of the slider."""
    rows: dict[str, list[int]] = {}
    for row, window in enumerate(windows):
        rows.setdefault(window.push_id, []).append(row)
    longest = sorted(rows.values(), key=len, reverse=True)
    several = [part for part in longest if len(part) >= 0.6 * len(longest[0])]
    by_turn = sorted(several, key=lambda part: sum(windows[row].displacement[2] for row in part))
    picked = np.unique(np.linspace(0, len(by_turn) - 1, min(count, len(by_turn))).round().astype(int))
    return [by_turn[k] for k in picked]


def paint_tracks(figure: Figure, windows: Sequence[PushWindow], comparison: Comparison) -> None:
    """One panel per push, turned so that the slider's centre moves from the origin to the right."""
    pushes = chosen_pushes(windows)
    axes = figure.subplots(len(pushes), 1, squeeze=False)[:, 0]
    for number, (ax, rows) in enumerate(zip(axes, pushes, strict=True)):
        _paint_track(ax, [windows[row] for row in rows], comparison, rows)
        if number == 0:
            outside_legend(figure, *ax.get_legend_handles_labels(), side="below", ncols=2)


def _paint_track(ax: Axes, windows: Sequence[PushWindow], comparison: Comparison, rows: Sequence[int]) -> None:
    track = np.array([windows[0].slider_start[:2], *[window.slider_end[:2] for window in windows]])
    origin, path = track[0], track[-1] - track[0]
    turn = -np.arctan2(path[1], path[0])
    grid(ax)
    for number, (window, row) in enumerate(zip(windows, rows, strict=True)):
        start = rotate(window.slider_start[:2] - origin, turn)
        mean, covariance = _in_track_frame(
            start, window.push_heading + turn, comparison.mean[row], comparison.covariance[row]
        )
        label = None if number else "predicted from the start of each window, 95 %"
        paint_ellipse(ax, mean, covariance, comparison.tails, label)
    seen = rotate(track - origin, turn) * UNITS[0]
    ax.plot(*seen.T, "-", color=OBSERVED, linewidth=0.8)
    ax.plot(*seen[1:].T, "D", color=OBSERVED, markersize=3.5, label="observed")
    ax.plot(0.0, 0.0, "o", color="0.2", markersize=4, fillstyle="none")
    ax.set_title(_title(windows, comparison, rows))
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(AROUND)
    ax.set(xlabel="along the track (mm)", ylabel="across (mm)")


def _title(windows: Sequence[PushWindow], comparison: Comparison, rows: Sequence[int]) -> str:
    c = comparison
    hits = sum(bool(inside(c.mean[r], c.covariance[r], c.observed[[r]], c.tails)[0]) for r in rows)
    turned = np.degrees(sum(window.displacement[2] for window in windows))
    text = f"{windows[0].velocity * 1e3:.0f} mm/s, rotation {turned:+.0f}°: {hits} of {len(rows)} inside"
    return text.replace("-", "−")


def _in_track_frame(start: Array, heading: float, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """Predicted mean and covariance, rotated from the push frame into one in which the push has that heading."""
    cos, sin = np.cos(heading), np.sin(heading)
    turn = np.array([[cos, -sin], [sin, cos]])
    return start + turn @ mean[:2], turn @ covariance[:2, :2] @ turn.T
