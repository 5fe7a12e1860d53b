# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The noise of repeated pushes: its size against the motion, its span, its shape on different surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from paper_studies import PLAN, made_up_grid, verdict_on
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.sections.noise import (
    Ratios,
    Shape,
    ceiling,
    noise_ratios,
    repeated_shapes,
    shape,
    size,
    span,
    span_of,
    spans,
)

from push_predictor.evaluation.estimate import Estimate
from push_predictor.types import Array

GRID = replace(PLAN, contacts=5, angle_step=0.5, repetitions=60)


def noisier(grid: RepeatedGrid, factor: Array) -> RepeatedGrid:
    """The grid with the noise of every push so much larger, (cells,)."""
    cells = tuple(
        replace(cell, outcomes=cell.outcomes.mean(axis=0) + by * (cell.outcomes - cell.outcomes.mean(axis=0)))
        for cell, by in zip(grid.cells, factor, strict=True)
    )
    return replace(grid, cells=cells)


def sure(value: float) -> Estimate:
    return Estimate(value, value, value)


def test_noise_of_a_known_part_of_the_mean() -> None:
    grid = made_up_grid(GRID)
    cells = [replace(c, outcomes=np.linspace(-1.0, 1.0, 60)[:, None] + np.zeros((60, 3))) for c in grid.seen]
    unit = float(cells[0].sd[0])
    cells = [replace(c, outcomes=c.outcomes / unit + [5.0, -2.0, 0.5]) for c in cells]
    dx, dy, dtheta, whole = noise_ratios(cells, arm=2.0)
    for part, expected in ((dx, 0.2), (dy, 0.5), (dtheta, 2.0), (whole, np.sqrt(6.0 / 30.0))):
        np.testing.assert_allclose(part.values, expected)
        assert part.overall.value == pytest.approx(expected)
    assert (dx.within.value, dy.within.value) == (1.0, 0.0)


def test_the_span_of_noise_that_varies_tenfold() -> None:
    rng, grid = np.random.default_rng(0), made_up_grid(replace(GRID, contacts=11, angle_step=0.2))
    alike = [replace(cell, outcomes=rng.standard_normal((GRID.repetitions, 3))) for cell in grid.cells]
    factor = 10.0 ** rng.random(len(grid.cells))
    for part in spans(noisier(replace(grid, cells=tuple(alike)), factor).seen):
        assert part.low < span_of(factor) < part.high < 1.2 * part.low


def test_surfaces_that_share_the_shape_of_their_noise_correlate_and_others_do_not() -> None:
    rng, plan = np.random.default_rng(0), replace(GRID, contacts=11, angle_step=0.25)
    grid = made_up_grid(plan)
    factor = np.exp(rng.normal(0.0, 1.0, len(grid.cells)))
    one = noisier(grid, factor)
    same = noisier(made_up_grid(plan, "delrin", 5), 3.0 * factor)
    other = noisier(made_up_grid(plan, "abs", 6), np.exp(rng.normal(0.0, 1.0, len(grid.cells))))
    found = {(s.first, s.second): s for s in repeated_shapes({"plywood": one, "delrin": same, "abs": other})}
    assert set(found) == {("plywood", "delrin"), ("plywood", "abs"), ("delrin", "abs")}
    assert min(e.low for e in found["plywood", "delrin"].correlations) > 0.9
    assert max(e.value for e in found["plywood", "abs"].correlations) < 0.5
    halves = ceiling(one)
    assert halves is not None and min(e.low for e in halves.correlations) > 0.9


def test_surfaces_without_common_pushes_are_not_compared() -> None:
    few = made_up_grid(replace(GRID, contacts=2, angle_step=3.0))
    assert repeated_shapes({"plywood": made_up_grid(GRID), "abs": few}) == []
    assert verdict_on("noise", "shape", shape({"repetitions": [], "VHGP": []}, None)) == "not decided"


def test_the_shape_is_that_of_the_pair_of_surfaces_that_agrees_least() -> None:
    pairs = [Shape("a", "b", 9, (Estimate(0.8, low, 0.9),) * 3) for low in (0.75, 0.2)]
    assert [f.estimate.low for f in shape({"repetitions": pairs, "VHGP": pairs[:1]}, pairs[0]).figures] == (
        [0.2] * 3 + [0.75] * 3
    )


@pytest.mark.parametrize(
    ("overall", "within", "verdict"),
    [
        ((0.2, 0.3), 0.9, "holds"),
        ((0.2, 0.3), 0.7, "holds in part"),
        ((0.5, 0.6), 0.9, "holds in part"),
        ((0.5, 0.6), 0.5, "does not hold"),
    ],
)
def test_the_size_needs_all_outputs_and_most_pushes(overall: tuple[float, float], within: float, verdict: str) -> None:
    part = Ratios(np.ones(9), sure(within), Estimate(0.25, *overall))
    assert verdict_on("noise", "size", size((part,) * 4)) == verdict


def test_the_span_is_that_of_the_output_where_it_is_widest() -> None:
    figures = span({"all": [sure(8.0), sure(12.0), sure(2.0)], "near": [sure(4.0)] * 3}).figures
    assert [figure.estimate.value for figure in figures] == [12.0, 4.0]
