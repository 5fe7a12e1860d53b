# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/pictures/architecture.png: the rooms of the project, and the direction of imports.

python docs/pictures/draw_architecture.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

PICTURE = Path(__file__).with_name("architecture.png")
ROS, LIBRARY, OUTSIDE = "#fbe6d4", "#e6eefb", "#eeeeee"
# Rows from top to bottom; (title, what it holds, colour, share of the row)
ROWS = (
    (
        ("push_predictor_paper", "the paper's claims", OUTSIDE, 2),
        ("benchmarks, examples", "figures and demos", OUTSIDE, 2),
    ),
    (
        ("api, commands", "Python interface, command line", LIBRARY, 2),
        ("nodes", "predict_server, push_replay,\npush_recorder, push_validator", ROS, 2.6),
        ("msg_adapters", "ROS messages ↔ arrays", ROS, 1.6),
    ),
    (
        ("online", "windows, scores and alarm of a live run", LIBRARY, 2),
        ("residuals", "trace: from residual to effect", LIBRARY, 2),
        ("replay", "player without ROS", LIBRARY, 1.2),
        ("simulation", "rig simulator", LIBRARY, 1.2),
        ("adaptation", "a model follows the rig", LIBRARY, 1.4),
    ),
    (
        ("evaluation", "metrics, alarm, reports", LIBRARY, 2),
        ("design", "pushes to record next", LIBRARY, 1.5),
        ("planning", "rollouts, choice of pushes", LIBRARY, 1.8),
        ("reporting", "pages and pictures", LIBRARY, 1.4),
    ),
    (("models", "mechanics, VHGP, GP; effects; tables; model files", LIBRARY, 1),),
    (("recordings", "bags, push tables, rigs, windows, importers", LIBRARY, 1),),
    (("geometry", "outlines, frames, contact", LIBRARY, 1),),
)


def main() -> None:
    """Draw the rows and the arrow, and save them."""
    figure, axes = plt.subplots(figsize=(10.5, 6.6))
    axes.set(xlim=(-0.06, 1.0), ylim=(-0.02, len(ROWS)))
    axes.axis("off")
    for height, row in enumerate(reversed(ROWS)):
        draw_row(axes, height, row)
    arrow = {"arrowstyle": "-|>", "color": "black", "lw": 1.6, "mutation_scale": 18}
    axes.annotate("", (-0.02, 0.1), (-0.02, len(ROWS) - 0.15), arrowprops=arrow)
    axes.text(-0.035, len(ROWS) / 2, "imports point down", rotation=90, ha="center", va="center")
    figure.subplots_adjust(left=0.01, right=0.995, bottom=0.01, top=0.995)
    figure.savefig(PICTURE, dpi=130)


def draw_row(axes: Axes, height: int, row: tuple[tuple[str, str, str, float], ...]) -> None:
    """One row of boxes, as wide as their shares."""
    whole, left = sum(share for *_, share in row), 0.0
    for title, holds, colour, share in row:
        width = share / whole
        box = FancyBboxPatch(
            (left + 0.008, height + 0.1),
            width - 0.016,
            0.74,
            boxstyle="round,pad=0,rounding_size=0.012",
            fc=colour,
            ec="#666666",
        )
        axes.add_patch(box)
        axes.text(left + width / 2, height + 0.6, title, ha="center", va="center", weight="bold", size=12)
        axes.text(left + width / 2, height + 0.32, holds, ha="center", va="center", size=9.5)
        left += width


if __name__ == "__main__":
    main()
