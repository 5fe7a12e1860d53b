# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Charts as SVG: positions, limits, ticks, titles."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from push_predictor.reporting import html
from push_predictor.reporting.chart import (
    SMALL,
    Band,
    Bars,
    Cells,
    Chart,
    Columns,
    Dots,
    Line,
    Mark,
    colour,
    limits_of,
    ticks,
)

LEFT, RIGHT, TOP, BOTTOM = 56.0, 286.0, 30.0, 188.0  # the plot area of a small chart


def chart(*marks: Mark, **other: Any) -> Chart:
    return Chart("a chart", "Time (s)", "Size (mm)", (0.0, 10.0), (0.0, 1.0), marks, size=SMALL, **other)


def dots(*points: tuple[float, float]) -> Dots:
    x, y = np.array(points).T
    return Dots("push", x, y, [f"push {k}" for k in range(len(points))])


def test_corners_of_the_data_are_corners_of_the_plot_area() -> None:
    first, last = chart(dots((0.0, 0.0), (10.0, 1.0))).shapes
    assert (first.attributes["cx"], first.attributes["cy"]) == (LEFT, BOTTOM)
    assert (last.attributes["cx"], last.attributes["cy"]) == (RIGHT, TOP)


def test_title_lowers_the_plot_area() -> None:
    assert chart(title="dx").box["top"] > chart().box["top"] == TOP


def test_dots_outside_the_limits_are_not_drawn() -> None:
    shapes = chart(dots((5.0, 0.5), (5.0, 1.5), (-1.0, 0.5), (5.0, np.nan))).shapes
    assert [shape.title for shape in shapes] == ["push 0"]


def test_bars_and_bands_end_at_the_border() -> None:
    one, x = np.ones(1), np.array([0.0, 10.0])
    stem, point = chart(Bars("held", 5.0 * one, 0.5 * one, -3.0 * one, 4.0 * one, ["0.5"])).shapes
    assert (stem.attributes["y1"], stem.attributes["y2"]) == (BOTTOM, TOP) and point.title == stem.title == "0.5"
    (band,) = chart(Band("fit", x, np.array([-1.0, -1.0]), np.array([2.0, 2.0]))).shapes
    assert band.attributes["points"] == f"{LEFT:g},{BOTTOM:g} {RIGHT:g},{BOTTOM:g} {RIGHT:g},{TOP:g} {LEFT:g},{TOP:g}"


def test_cells_have_colours_and_unknown_ones_none() -> None:
    values = np.array([[1.0, np.nan]])
    known, unknown = chart(Cells("", np.array([0.0, 5.0, 10.0]), np.array([0.0, 1.0]), values, [["a", "b"]])).shapes
    assert known.attributes["fill"] == colour(1.0) and "fill" not in unknown.attributes
    assert unknown.attributes["class"] == "cell empty" and unknown.title == "b"
    assert known.attributes["width"] == (RIGHT - LEFT) / 2.0 and known.attributes["height"] == BOTTOM - TOP


def test_histogram_stands_on_zero() -> None:
    (bar,) = chart(Columns("before", np.array([0.0, 10.0]), np.array([0.5]))).shapes
    assert float(bar.attributes["y"]) + float(bar.attributes["height"]) == BOTTOM
    assert float(bar.attributes["height"]) == (BOTTOM - TOP) / 2.0


def test_colours_are_symmetric_and_limited() -> None:
    assert colour(0.0) == "#f7f7f7" and colour(5.0) == colour(1.0) != colour(-1.0) == colour(-5.0)


@pytest.mark.parametrize(
    ("limits", "most", "labels"),
    [
        ((0.0, 1.0), 5, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        ((-0.3, 0.3), 4, ["−0.2", "0.0", "0.2"]),
        ((0.0, 170.0), 4, ["0", "50", "100", "150"]),
        ((0.0, 1.0), 4, ["0.00", "0.25", "0.50", "0.75", "1.00"]),
        ((0.0, 10.0), 4, ["0.0", "2.5", "5.0", "7.5", "10.0"]),
    ],
)
def test_ticks_are_round_and_of_equal_precision(limits: tuple[float, float], most: int, labels: list[str]) -> None:
    assert [text for _, text in ticks(limits, most)] == labels


@pytest.mark.parametrize("reach", [1e-9, 3e8, 123456789.0])
def test_labels_of_ticks_fit_beside_the_axis(reach: float) -> None:
    assert max(len(text) for _, text in ticks((-reach, reach), 4)) <= 8


def test_limits_contain_all_finite_values_and_have_a_width() -> None:
    low, high = limits_of(np.array([1.0, np.nan]), np.array([3.0, np.inf]))
    assert low < 1.0 and high > 3.0
    for values in (np.zeros(3), np.full(3, 2.0), np.array([np.nan]), np.zeros(0)):
        low, high = limits_of(values)
        assert high > low


def test_page_contains_the_chart_with_titles_legend_and_caption() -> None:
    shown = chart(
        Line("fit", np.array([0.0, 1.0]), np.array([0.0, 1.0]), name="as fitted"),
        dots((1.0, 0.5)),
        names={3.0: "three"},
    )
    part = str(html.charts([shown, shown], "A caption."))
    assert part.count('viewBox="0 0 300 230"') == 2 and "<title>push 0</title>" in part and "A caption." in part
    assert part.count("as fitted") == 1 and ">three<" in part and 'aria-label="a chart"' in part


def test_texts_of_a_chart_are_escaped() -> None:
    evil = Dots("push", np.ones(1), np.full(1, 0.5), ["<script>"], name="<b>")
    part = str(html.charts([chart(evil, title="<i>")], "<u>"))
    assert not re.search("<script>|<b>|<i>|<u>", part) and "&lt;script&gt;" in part


def test_charts_are_in_rows_of_the_given_width() -> None:
    assert str(html.charts([chart()] * 6, "", 2)).count('<div class="charts">') == 3
    assert str(html.charts([chart()] * 6, "")).count('<div class="charts">') == 1


def test_numbers_that_are_unknown_are_dashes() -> None:
    assert [html.number(value) for value in (None, float("nan"), float("inf"))] == [html.NOTHING] * 3
