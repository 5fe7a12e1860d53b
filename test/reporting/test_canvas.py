# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Legends outside the axes: the axes leave room for them, with every matplotlib from 3.6 on."""

from __future__ import annotations

from pathlib import Path

import pytest
from repository import REPOSITORY

from push_predictor.reporting.canvas import draw, outside_legend


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


def test_no_figure_uses_what_came_with_matplotlib_3_7():
    for room in ("push_predictor", "push_predictor_paper", "examples"):
        for path in (REPOSITORY / room).rglob("*.py"):
            assert 'loc="outside' not in path.read_text() and ".legend_handles" not in path.read_text(), path
