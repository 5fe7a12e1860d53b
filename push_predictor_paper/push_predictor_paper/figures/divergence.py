# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""KL of models from repeated pushes: map over the side, and distribution over all pushes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import COLOURS, EMPTY, NEARBY, grid
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

NAMES = {"analytical": "analytical", "gp": "GP", "vhgp": "VHGP"}
KIND_COLOURS = {"analytical": NEARBY, "gp": COLOURS[1], "vhgp": COLOURS[0]}


def paint_divergence(figure: Figure, repeated: RepeatedGrid, kl: Mapping[str, Array], floor: float) -> None:
    """Draw maps of the KL (p,) of GP and VHGP on one log scale, and the distribution for all models."""
    from matplotlib.colors import LogNorm

    first, second, curve = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.2))
    shown = np.concatenate([kl["gp"], kl["vhgp"]])
    norm = LogNorm(max(float(shown.min()), 1e-3), float(shown.max()))
    for ax, kind in ((first, "gp"), (second, "vhgp")):
        image = _paint_map(ax, repeated, kl[kind], norm)
        ax.set_title(f"KL(repetitions || {NAMES[kind]})")
    first.set_ylabel("push angle (deg)")
    figure.colorbar(image, ax=[first, second], label="KL (nats, three outputs)", pad=0.02, format="{x:g}")
    _paint_curves(curve, kl, floor)


def _paint_map(ax: Axes, repeated: RepeatedGrid, values: Array, norm: Normalize) -> QuadMesh:
    cells = np.full(len(repeated.cells), np.nan)
    cells[[cell.enough for cell in repeated.cells]] = values
    table = cells.reshape(len(repeated.fractions), len(repeated.angles)).T
    ax.set_facecolor(EMPTY)
    image = ax.pcolormesh(
        repeated.fractions, np.degrees(repeated.angles), table, shading="nearest", cmap="viridis", norm=norm
    )
    ax.set_xlabel("contact, fraction of the side")
    return image


def _paint_curves(ax: Axes, kl: Mapping[str, Array], floor: float) -> None:
    grid(ax)
    for kind, values in kl.items():
        ordered = np.sort(values)
        share = np.arange(1, len(ordered) + 1) / len(ordered)
        ax.step(ordered, 100.0 * share, where="post", color=KIND_COLOURS[kind], linewidth=1.6, label=NAMES[kind])
        ax.plot(np.median(values), 50.0, "o", color=KIND_COLOURS[kind], markersize=4)
    ax.axvline(floor, color="black", linewidth=1.0, linestyle=":", label=f"perfect model: {floor:.3f}")
    ax.set_xscale("log")
    ax.set_ylim(0.0, 100.0)
    ax.set_xlabel("KL (nats, three outputs)")
    ax.set_ylabel("cumulative share of pushes (%)")
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), borderaxespad=0.2, ncols=2)
    ax.xaxis.set_major_formatter("{x:g}")
