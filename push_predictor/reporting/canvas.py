# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Conventions of all figures: colours, units, saving. Matplotlib is imported only when a figure is drawn."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.recordings.atomic import write_whole
from push_predictor.types import ByteArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

DPI = 160
LEGEND_PAD = 0.12  # inches around a legend outside the axes
LAYOUTS = 2  # the first moves colour bars and axes of equal scales, which changes their ticks: the second fits
COMPRESSION = 3  # of PNG: a file of a tenth more bytes than by the default of 6, in half the time
UNITS = (1e3, 1e3, 180.0 / np.pi)  # factors from m, m, rad to mm, mm, deg
UNIT_NAMES = ("mm", "mm", "deg")
SYMBOLS = (r"$\Delta x$", r"$\Delta y$", r"$\Delta\theta$")
COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe and Ito: distinct for colour-blind readers
PREDICTED, OBSERVED, NEARBY, START = "#0072B2", "#D55E00", "#6b6b6b", "#b0b0b0"
EMPTY = "#ececec"
STYLE = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "axes.axisbelow": True,
    "axes.titley": 1.0,  # where it would be put; to find that out, the ticks are computed again in each layout
    "grid.color": "#e4e4e4",
    "hatch.color": "#c4c4c4",
    "hatch.linewidth": 0.6,
    "legend.frameon": False,
    "mathtext.fontset": "dejavusans",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@dataclass(frozen=True)
class Picture:
    """A figure: its file, its alternative text and its caption."""

    path: Path
    alt: str
    caption: str


def draw(path: Path, size: tuple[float, float], paint: Callable[[Figure], None]) -> Path:
    """Paint a figure of that size (inches), write it as PNG and return its path; no partial file remains.

    Raises PushPredictorError if matplotlib is not installed.
    """
    image = io.BytesIO()
    with _painted(path.name, size, paint) as canvas:
        canvas.print_png(image, pil_kwargs={"compress_level": COMPRESSION})
    write_whole(path, image.getvalue())
    return path


def pixels(name: str, size: tuple[float, float], paint: Callable[[Figure], None]) -> ByteArray:
    """Paint a figure of that size (inches) and return its pixels (height, width, 3), uint8.

    name: of the picture in the PushPredictorError that is raised if matplotlib is not installed.
    """
    with _painted(name, size, paint) as canvas:
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


@contextmanager
def _painted(name: str, size: tuple[float, float], paint: Callable[[Figure], None]) -> Iterator[FigureCanvasAgg]:
    """A painted figure with its style."""
    try:
        from matplotlib import rc_context
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise PushPredictorError(
            f"{name}: pictures need matplotlib ({error}); pip install 'push_predictor[report]'"
        ) from None
    with rc_context(STYLE):
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        paint(figure)
        _place_empty_labels(figure)
        _lay_out(figure)
        yield canvas


def _place_empty_labels(figure: Figure) -> None:
    """Give axis labels without text any place: it is searched for among the ticks, in each layout and when drawn."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if not axis.get_label_text():
                axis.set_label_coords(0.5, 0.5)


def _lay_out(figure: Figure) -> None:
    """Fix the positions of the axes. `savefig` would draw the whole figure once more for each layout."""
    engine = figure.get_layout_engine()
    if engine is not None:
        for _ in range(min(LAYOUTS, 1) if _settles_at_once(figure) else LAYOUTS):
            engine.execute(figure)
        figure.set_layout_engine("none")


def _settles_at_once(figure: Figure) -> bool:
    """Whether a second layout would move nothing by as much as a pixel."""
    return all(axes.get_aspect() == "auto" and axes.get_label() != "<colorbar>" for axes in figure.axes)


def outside_legend(
    figure: Figure, handles: Iterable[Any], labels: Iterable[str], *, side: str, **looks: float
) -> Legend:
    """Add a legend next to all axes, and leave room for it. side: above, below or right of them.

    As the places "outside ..." of matplotlib 3.7 do; Ubuntu 24.04 has 3.6.
    """
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    places = {"above": "upper center", "below": "lower center", "right": "upper right"}
    legend = figure.legend(list(handles), list(labels), loc=places[side], **looks)
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        box = legend.get_window_extent()
        pad = LEGEND_PAD * figure.dpi
        width, height = (box.width + pad) / figure.bbox.width, (box.height + pad) / figure.bbox.height
        rooms = {"above": (0, 0, 1, 1 - height), "below": (0, height, 1, 1 - height), "right": (0, 0, 1 - width, 1)}
        engine.set(rect=rooms[side])
    return legend


def output_label(index: int) -> str:
    """The label of an axis: an output with its unit."""
    return f"{SYMBOLS[index]} ({UNIT_NAMES[index]})"


def grid(axes: Axes) -> None:
    """Draw a faint grid behind the data."""
    axes.grid(True, linewidth=0.6)
