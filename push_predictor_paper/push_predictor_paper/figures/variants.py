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

"""Scores of other kernels minus those of the plain squared exponential, by size and split."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import COLOURS, grid, outside_legend
from push_predictor_paper.estimate import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = ("o", "s", "^")
Curves = Mapping[str, Sequence[Estimate]]  # by variant, one a size


def paint_variants(figure: Figure, sizes: Sequence[int], panels: Mapping[tuple[str, str], Curves]) -> None:
    """Draw a panel per (quantity, split), two rows of two; below zero is better than the plain kernel."""
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for number, (ax, ((quantity, split), curves)) in enumerate(zip(axes.flat, panels.items(), strict=True)):
        grid(ax)
        ax.axhline(0.0, color="0.2", linewidth=1.0, linestyle="--", label="plain kernel")
        for k, (variant, estimates) in enumerate(curves.items()):
            _paint_curve(ax, k, variant, estimates)
        if number % 2 == 0:
            ax.set_ylabel(f"{quantity},\nminus the plain kernel's")
        if number < 2:
            ax.set_title(split)
        else:
            ax.set_xlabel("training windows")
        ax.set_xticks(np.arange(len(sizes)), [str(n) for n in sizes])
        ax.set_xlim(-0.5, len(sizes) - 0.5)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    outside_legend(figure, handles, labels, side="above", ncols=2)


def _paint_curve(ax: Axes, k: int, variant: str, estimates: Sequence[Estimate]) -> None:
    value = np.array([e.value for e in estimates])
    ends = np.maximum([value - [e.low for e in estimates], [e.high for e in estimates] - value], 0.0)
    place = np.arange(float(len(estimates))) + 0.16 * (k - 1)
    ax.errorbar(place, value, ends, fmt=MARKS[k], color=COLOURS[k], capsize=3.0, markersize=5.0, label=variant)
