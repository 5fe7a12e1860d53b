# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Legends outside the axes: the axes leave room for them, with every matplotlib from 3.6 on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from repository import REPOSITORY

from push_predictor.reporting.canvas import STYLE, draw, outside_legend


@pytest.mark.parametrize("side", ["above", "below", "right"])
def test_no_axes_reach_into_the_legend(side: str, tmp_path: Path):
    seen = []

    def paint(figure):
        for ax in figure.subplots(2, 1):
            ax.plot([0, 1], [0, 1])
            ax.set(title="title", xlabel="label")
        seen.append((figure, outside_legend(figure, ax.lines, ["a line"], side=side)))

    draw(tmp_path / "picture.png", (3.0, 3.0), paint)
    ((figure, legend),) = seen
    renderer = figure.canvas.get_renderer()
    box = legend.get_window_extent(renderer)
    assert (
        figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1 and figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1
    )
    for ax in figure.axes:
        reach = ax.get_tightbbox(renderer)
        free = {"above": reach.y1 <= box.y0, "below": box.y1 <= reach.y0, "right": reach.x1 <= box.x0}
        assert free[side] and reach.width > 0.5 * figure.bbox.width


def plain(figure):
    one, other = figure.subplots(1, 2)
    one.plot([0, 2000], [0, 1])
    one.set(title="title", ylabel="label")
    other.plot([0, 1e-3], [0, 1])


def equal_scales(figure):
    axes = figure.subplots(2, 2)
    for ax, reach in zip(axes[0], (1.0, 1e3), strict=True):
        ax.plot([0, reach], [0, reach])
        ax.set(title="title", xlabel="label", ylabel="label", aspect="equal")


def colour_bar(figure):
    axes = figure.subplots(2, 1)
    for ax in axes:
        image = ax.pcolormesh(np.linspace(-1e3, 1e3, 12).reshape(3, 4))
    figure.colorbar(image, ax=list(axes), label="label")


@pytest.mark.parametrize("paint", [plain, equal_scales, colour_bar])
def test_what_is_spared_moves_nothing(paint, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def places():
        seen = []
        draw(tmp_path / "picture.png", (3.0, 3.0), lambda figure: (seen.append(figure), paint(figure)))
        from matplotlib.text import Text  # not at the top: every worker imports every test

        shown = [*seen[0].axes, *(text for text in seen[0].findobj(Text) if text.get_text())]
        return np.array([artist.get_window_extent().extents for artist in shown])

    spared = places()
    monkeypatch.setattr("push_predictor.reporting.canvas._place_empty_labels", lambda figure: None)
    monkeypatch.setattr("push_predictor.reporting.canvas._settles_at_once", lambda figure: False)
    monkeypatch.delitem(STYLE, "axes.titley")
    np.testing.assert_allclose(spared, places(), atol=0.5)  # pixels


def test_no_figure_uses_what_came_with_matplotlib_3_7():
    for room in ("push_predictor", "push_predictor_paper", "examples"):
        for path in (REPOSITORY / room).rglob("*.py"):
            assert 'loc="outside' not in path.read_text() and ".legend_handles" not in path.read_text(), path
