# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Charts as inline SVG: sharp at every width, and hovering over a mark shows its title, such as the name of a push.

The colours of the kinds are in templates/style.css.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from push_predictor.types import Array, BoolArray

WIDE = (560.0, 300.0)  # pixels, of a chart alone; text has 13 of them
HALF = (460.0, 290.0)  # of two in a row
SMALL = (300.0, 230.0)  # of several in a row
LEFT, RIGHT, TOP, BOTTOM = 56.0, 14.0, 30.0, 42.0
LINE = 19.0  # height of a title
LONGEST = 7  # characters of a tick's label
ROOM_X, ROOM_Y = 90.0, 45.0  # pixels between ticks
DOT, POINT = 3.0, 4.5  # radii of a single push and of an estimate
ENDS = ((179, 88, 6), (247, 247, 247), (84, 39, 136))  # orange, white, purple: distinct for colour-blind readers


@dataclass(frozen=True)
class Shape:
    """One SVG element with its attributes and the title that hovering shows."""

    tag: str
    attributes: Mapping[str, str | float]
    title: str = ""


@dataclass(frozen=True)
class Frame:
    """The plot area in pixels, and the limits of the data in it."""

    x: tuple[float, float]
    y: tuple[float, float]
    size: tuple[float, float]
    top: float = TOP

    def across(self, x: Array | float) -> Array:
        """Pixels from the left."""
        return LEFT + (np.asarray(x, dtype=np.float64) - self.x[0]) / (self.x[1] - self.x[0]) * (
            self.size[0] - LEFT - RIGHT
        )

    def down(self, y: Array | float) -> Array:
        """Pixels from the top; what lies outside is drawn at the border."""
        share = (np.asarray(y, dtype=np.float64) - self.y[0]) / (self.y[1] - self.y[0])
        return self.top + (1.0 - np.clip(share, 0.0, 1.0)) * (self.size[1] - self.top - BOTTOM)

    def inside(self, x: Array, y: Array) -> BoolArray:
        """Which points (n,) lie in the plot area; NaN does not."""
        within = (x >= self.x[0]) & (x <= self.x[1]) & (y >= self.y[0]) & (y <= self.y[1])
        return np.asarray(within)


@dataclass(frozen=True, eq=False)
class Mark(ABC):
    """What a chart shows; kind: its colour; name: in the legend, none if empty."""

    kind: str
    name: str = field(default="", kw_only=True)
    swatch = "dot"

    @abstractmethod
    def shapes(self, frame: Frame) -> Iterator[Shape]:
        """The SVG elements of the mark."""


@dataclass(frozen=True, eq=False)
class Dots(Mark):
    """A dot with a title for each point; values (n,) between -1 and 1 colour the dots instead of the kind."""

    x: Array
    y: Array
    titles: Sequence[str]
    values: Array | None = None

    def shapes(self, frame: Frame) -> Iterator[Shape]:
        """A circle for each point inside the plot area."""
        fills = [None] * len(self.x) if self.values is None else [colour(value) for value in self.values]
        rows = zip(self.x, self.y, self.titles, fills, frame.inside(self.x, self.y), strict=True)
        for x, y, title, fill, inside in rows:
            if inside:
                look: dict[str, str | float] = {"r": DOT} if fill is None else {"r": POINT, "fill": fill}
                yield Shape("circle", {"class": f"dot {self.kind}", **_at(frame, x, y), **look}, title)


@dataclass(frozen=True, eq=False)
class Bars(Mark):
    """Estimates with their 95 % intervals."""

    x: Array
    y: Array
    low: Array
    high: Array
    titles: Sequence[str]

    def shapes(self, frame: Frame) -> Iterator[Shape]:
        """A circle and a vertical line for each estimate."""
        for x, y, low, high, title in zip(self.x, self.y, self.low, self.high, self.titles, strict=True):
            across = _round(frame.across(x))
            ends = {"y1": _round(frame.down(low)), "y2": _round(frame.down(high))}
            yield Shape("line", {"class": f"stem {self.kind}", "x1": across, "x2": across, **ends}, title)
            yield Shape("circle", {"class": f"point {self.kind}", **_at(frame, x, y), "r": POINT}, title)


@dataclass(frozen=True, eq=False)
class Line(Mark):
    """A line through the points."""

    x: Array
    y: Array
    swatch = "line"

    def shapes(self, frame: Frame) -> Iterator[Shape]:
        """One polyline."""
        yield Shape("polyline", {"class": f"line {self.kind}", "points": _points(frame, self.x, self.y)})


@dataclass(frozen=True, eq=False)
class Band(Mark):
    """The area between two lines."""

    x: Array
    low: Array
    high: Array
    swatch = "band"

    def shapes(self, frame: Frame) -> Iterator[Shape]:
        """One polygon."""
        outline = _points(frame, self.x, self.low), _points(frame, self.x[::-1], self.high[::-1])
        yield Shape("polygon", {"class": f"band {self.kind}", "points": " ".join(outline)})


@dataclass(frozen=True, eq=False)
class Cells(Mark):
    """Coloured cells (r, c) between edges (c + 1,) and (r + 1,): values from -1 to 1, NaN for an empty cell."""

    x: Array
    y: Array
    values: Array
    titles: Sequence[Sequence[str]]

    def shapes(self, frame: Frame) -> Iterator[Shape]:
        """A rectangle for each cell."""
        across, down = frame.across(self.x), frame.down(self.y)
        for (r, c), value in np.ndenumerate(self.values):
            place = {"x": _round(across[c]), "y": _round(down[r + 1])}
            size = {"width": _round(across[c + 1] - across[c]), "height": _round(down[r] - down[r + 1])}
            look = {"class": "cell empty"} if np.isnan(value) else {"class": "cell", "fill": colour(value)}
            yield Shape("rect", {**look, **place, **size}, self.titles[r][c])


@dataclass(frozen=True, eq=False)
class Columns(Mark):
    """A histogram: heights (n,) between edges (n + 1,)."""

    edges: Array
    heights: Array

    def shapes(self, frame: Frame) -> Iterator[Shape]:
        """A rectangle for each bar."""
        across, down, foot = frame.across(self.edges), frame.down(self.heights), float(frame.down(0.0))
        for k, top in enumerate(down):
            box = {"x": _round(across[k]), "width": _round(across[k + 1] - across[k])}
            upright = {"y": _round(top), "height": _round(foot - top)}
            yield Shape("rect", {"class": f"column {self.kind}", **box, **upright}, f"{self.heights[k]:g}")


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart with its labels, limits and marks; those drawn later cover the earlier.

    label: what the chart shows, for readers who cannot see it. y_label stands above the axis. names: of
    places on the x axis, instead of numbers. key: the ends of a colour scale and what it means.
    """

    label: str
    x_label: str
    y_label: str
    x: tuple[float, float]
    y: tuple[float, float]
    marks: tuple[Mark, ...]
    title: str = ""
    size: tuple[float, float] = WIDE
    names: Mapping[float, str] = field(default_factory=dict)
    key: tuple[str, str, str] | None = None

    @property
    def frame(self) -> Frame:
        """The plot area."""
        return Frame(self.x, self.y, self.size, TOP + LINE * bool(self.title))

    @property
    def shapes(self) -> list[Shape]:
        """All SVG elements, without the axes."""
        return [shape for mark in self.marks for shape in mark.shapes(self.frame)]

    @property
    def x_ticks(self) -> list[tuple[float, str]]:
        """Pixels from the left, and labels."""
        named = self.names.items() if self.names else ticks(self.x, int((self.size[0] - LEFT - RIGHT) // ROOM_X) + 1)
        return [(_round(self.frame.across(place)), text) for place, text in named]

    @property
    def y_ticks(self) -> list[tuple[float, str]]:
        """Pixels from the top, and labels."""
        shown = ticks(self.y, int((self.size[1] - self.frame.top - BOTTOM) // ROOM_Y) + 1)
        return [(_round(self.frame.down(place)), text) for place, text in shown]

    @property
    def box(self) -> dict[str, float]:
        """The plot area's left, right, top and bottom in pixels."""
        width, height = self.size
        return {"left": LEFT, "right": width - RIGHT, "top": self.frame.top, "bottom": height - BOTTOM}

    @property
    def legend(self) -> list[Mark]:
        """Marks with a name."""
        return [mark for mark in self.marks if mark.name]


def ticks(limits: tuple[float, float], most: int) -> list[tuple[float, str]]:
    """Round numbers between the limits, at most about that many, with labels of equal precision."""
    low, high = limits
    rough = (high - low) / max(most, 2)
    power = 10.0 ** np.floor(np.log10(rough))
    step = power * next(factor for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if factor * power >= 0.999 * rough)
    decimals = max(0, -int(np.floor(np.log10(step) + 1e-9))) + int(round(step / power, 3) == 2.5 and power <= 1.0)
    places = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1.0)
    return [(float(place), _tick(float(place) + 0.0, decimals)) for place in places]


def _tick(place: float, decimals: int) -> str:
    """A label that fits to the left of an axis."""
    text = f"{place:.{decimals}f}"
    return (text if len(text) <= LONGEST else f"{place:.2g}").replace("-", "−")


def limits_of(*values: Array, margin: float = 0.06) -> tuple[float, float]:
    """Limits that contain all finite values, with a margin."""
    every = np.concatenate([np.ravel(np.asarray(part, dtype=np.float64)) for part in values])
    known = every[np.isfinite(every)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    room = margin * (high - low) if high - low > 1e-9 * max(abs(low), abs(high)) else 0.5 * abs(high) or 1.0
    return low - room, high + room


def colour(value: float) -> str:
    """The colour of a value between -1 (purple) and 1 (orange); beyond, that of the end."""
    share = float(np.clip(value, -1.0, 1.0))
    end, middle = np.array(ENDS[0] if share > 0.0 else ENDS[2]), np.array(ENDS[1])
    red, green, blue = np.round(middle + abs(share) * (end - middle)).astype(int)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _points(frame: Frame, x: Array, y: Array) -> str:
    return " ".join(f"{a:g},{b:g}" for a, b in zip(_rounded(frame.across(x)), _rounded(frame.down(y)), strict=True))


def _at(frame: Frame, x: float, y: float) -> dict[str, float]:
    return {"cx": _round(frame.across(x)), "cy": _round(frame.down(y))}


def _rounded(values: Array) -> list[float]:
    return [_round(value) for value in values]


def _round(value: Array | float) -> float:
    """Pixels to a tenth: a page stays small."""
    return round(float(value), 1)
