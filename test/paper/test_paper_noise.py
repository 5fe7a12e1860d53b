# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The noise of repeated pushes: its size against the motion, its span, its shape on different surfaces."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paper_studies import PLAN, made_up_corpus, made_up_grid, made_up_study
from push_predictor_paper.claims.noise.learned import learned_figures
from push_predictor_paper.claims.noise.section import section
from push_predictor_paper.claims.noise.shape import shape_finding
from push_predictor_paper.claims.noise.size import size_finding, sized, span_finding
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.fits.map_models import ModelMap
from push_predictor_paper.statistics.noise_figures import Ratios, Span, noise_ratios, radius_of_gyration, span_of, spans
from push_predictor_paper.statistics.noise_shapes import Shape, ceiling, shapes

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


def ratio(low: float, high: float, within: float) -> Ratios:
    return Ratios(np.ones(9), (0.1,) * 5, sure(within), Estimate(0.5 * (low + high), low, high))


def shape(low: float, high: float) -> Shape:
    return Shape("one", "other", 99, (Estimate(0.5 * (low + high), low, high),) * 3, (sure(0.5),) * 3)


def test_noise_of_a_known_part_of_the_mean() -> None:
    grid = made_up_grid(GRID)
    cells = [replace(c, outcomes=np.linspace(-1.0, 1.0, 60)[:, None] + np.zeros((60, 3))) for c in grid.seen]
    unit = float(cells[0].sd[0])
    cells = [replace(c, outcomes=c.outcomes / unit + [5.0, -2.0, 0.5]) for c in cells]
    dx, dy, dtheta, whole = noise_ratios(cells, arm=2.0)
    for part, expected in ((dx, 0.2), (dy, 0.5), (dtheta, 2.0), (whole, np.sqrt(6.0 / 30.0))):
        np.testing.assert_allclose(part.values, expected)
        assert part.overall.value == pytest.approx(expected)
        np.testing.assert_allclose(part.quantiles, expected)
    assert (dx.within.value, dy.within.value) == (1.0, 0.0)


def test_the_span_of_noise_that_varies_tenfold() -> None:
    rng, grid = np.random.default_rng(0), made_up_grid(replace(GRID, contacts=11, angle_step=0.2))
    alike = [replace(cell, outcomes=rng.standard_normal((GRID.repetitions, 3))) for cell in grid.cells]
    factor = 10.0 ** rng.random(len(grid.cells))
    for part in spans(noisier(replace(grid, cells=tuple(alike)), factor).seen):
        assert part.most.low < span_of(factor) < part.most.high < 1.2 * part.most.low
        assert part.extreme.value > part.most.value


def test_a_square_plates_radius_of_gyration() -> None:
    assert radius_of_gyration(made_up_grid()) == pytest.approx(0.09 / np.sqrt(6.0))


def test_surfaces_that_share_the_shape_of_their_noise_correlate_and_others_do_not() -> None:
    rng, plan = np.random.default_rng(0), replace(GRID, contacts=11, angle_step=0.25)
    grid = made_up_grid(plan)
    factor = np.exp(rng.normal(0.0, 1.0, len(grid.cells)))
    one = noisier(grid, factor)
    same = noisier(made_up_grid(plan, "delrin", 5), 3.0 * factor)
    other = noisier(made_up_grid(plan, "abs", 6), np.exp(rng.normal(0.0, 1.0, len(grid.cells))))
    found = {(s.first, s.second): s for s in shapes({"plywood": one, "delrin": same, "abs": other})}
    assert set(found) == {("plywood", "delrin"), ("plywood", "abs"), ("delrin", "abs")}
    assert min(e.low for e in found["plywood", "delrin"].pearson) > 0.9
    assert max(e.value for e in found["plywood", "abs"].pearson) < 0.5
    halves = ceiling(one)
    assert halves is not None and min(e.low for e in halves.pearson) > 0.9
    near = shapes({"plywood": one, "delrin": same}, widest=0.6)[0]
    assert near.pushes == 11 * 5


def test_surfaces_without_common_pushes_are_not_compared() -> None:
    assert shapes({"plywood": made_up_grid(GRID), "abs": made_up_grid(replace(GRID, contacts=2, angle_step=3.0))}) == []
    assert shape_finding([], [], None, []).verdict == "not decided"
    assert shape_finding([shape(0.9, 1.0)], [], None, []).verdict == "not decided"


@pytest.mark.parametrize(
    "ends, verdict",
    [
        ([(0.8, 0.9), (0.8, 0.9)], "holds"),
        ([(0.8, 0.9), (0.4, 0.6)], "holds in part"),
        ([(0.1, 0.5), (0.1, 0.5)], "not decided"),
        ([(-0.2, 0.2), (0.0, 0.2)], "does not hold"),
    ],
)
def test_the_verdict_on_the_shape_follows_from_all_pairs(ends: list[tuple[float, float]], verdict: str) -> None:
    found = [shape(*pair) for pair in ends]
    assert shape_finding(found, found, shape(0.9, 1.0), found).verdict == verdict
    alone = {"holds": "holds in part", "does not hold": "not decided"}  # the VHGPs cannot say anything
    assert shape_finding(found, found, shape(0.9, 1.0), []).verdict == alone.get(verdict, verdict)


def test_repetitions_and_models_that_disagree_on_the_shape_make_it_hold_in_part() -> None:
    alike, unlike = [shape(0.8, 0.9)], [shape(0.0, 0.2)]
    assert shape_finding(alike, alike, shape(0.9, 1.0), unlike).verdict == "holds in part"


@pytest.mark.parametrize(
    "overall, within, verdict",
    [
        ((0.2, 0.3), 0.9, "holds"),
        ((0.2, 0.3), 0.7, "holds in part"),
        ((0.05, 0.3), 0.4, "not decided"),
        ((0.05, 0.3), 0.6, "holds in part"),
        ((0.5, 0.6), 0.5, "not decided"),
        ((0.5, 0.6), 0.4, "does not hold"),
        ((0.01, 0.02), 0.1, "does not hold"),
    ],
)
def test_the_verdict_on_the_size(overall: tuple[float, float], within: float, verdict: str) -> None:
    assert size_finding((ratio(*overall, within),) * 4, made_up_grid()).verdict == verdict


def test_a_share_of_pushes_that_is_uncertain_does_not_make_the_size_hold() -> None:
    inside = [Estimate(0.25, 0.2, 0.3)] * 3
    assert sized(inside, Estimate(0.85, 0.75, 0.95)) == "holds in part"
    assert sized([Estimate(0.25, 0.05, 0.5)] * 3, Estimate(0.55, 0.4, 0.7)) == "not decided"
    assert sized([Estimate(0.5, 0.45, 0.6)] * 3, Estimate(0.45, 0.4, 0.55)) == "not decided"


@pytest.mark.parametrize(
    "everywhere, near, verdict",
    [
        ((8.0, 12.0), (4.0, 6.0), "holds"),
        ((8.0, 12.0), (2.0, 4.0), "holds in part"),
        ((30.0, 40.0), (4.0, 6.0), "holds in part"),
        ((2.0, 4.0), (1.5, 2.0), "not decided"),
        ((2.0, 3.0), (1.5, 2.0), "does not hold"),
        ((50.0, 90.0), (40.0, 60.0), "does not hold"),
    ],
)
def test_the_verdict_on_the_span(everywhere: tuple[float, float], near: tuple[float, float], verdict: str) -> None:
    small = Span(sure(1.5), sure(1.5))
    reach = {
        name: (small, Span(Estimate(sum(ends) / 2.0, *ends), sure(9.0)), small)
        for name, ends in (("all", everywhere), ("near", near))
    }
    assert span_finding(reach, {"all": 30, "near": 20}).verdict == verdict


def test_learned_noise_has_the_size_of_the_truth() -> None:
    mean, sd = np.full((3, 4, 3), 2.0), np.full((3, 4, 3), 0.5)
    mean[0, 0] = np.nan
    sd[1] = 1.0
    sd[1, 0] = np.nan
    mean[1, 0] = np.nan
    rms, median, within, span = learned_figures([ModelMap(mean, 9.0 * sd, sd, None)] * 2, 1)
    assert rms.value == pytest.approx(np.sqrt((7 * 0.25 + 3.0) / 10.0) / 2.0)
    assert (median.value, span.value) == (0.25, 2.0)
    assert within.value == pytest.approx(0.7) and within.low == within.high == within.value


@pytest.mark.long
def test_the_section_keeps_simulated_and_measured_noise_apart(tmp_path: Path) -> None:
    study = made_up_study(tmp_path)
    slow = replace(made_up_corpus(speeds=(0.02,)), origin="measured", title="a measured square")
    fast = replace(made_up_corpus(speeds=(0.3,)), origin="measured", title="a fast square")
    made = section(replace(study, measured=(slow, fast)))
    learned = [table for table in made.tables if table.caption.startswith("The process noise")]
    assert [("made up" in table.caption, "measured" in table.caption) for table in learned] == [
        (True, False),
        (False, True),
    ]
    assert any(note.startswith("a fast square") for note in made.notes)
    assert [picture.path.exists() for picture in made.pictures] == [True] * 3
    json.dumps(made.data, allow_nan=False)


@pytest.mark.slow
def test_a_grid_on_one_surface_has_no_shape_to_compare(tmp_path: Path) -> None:
    study = made_up_study(tmp_path)
    made = section(replace(study, grids={"plywood": study.reference_grid}))
    assert made.findings[2].verdict == "not decided" and len(made.pictures) == 2


def test_grid_with_too_few_repetitions_decides_nothing(tmp_path: Path) -> None:
    study = made_up_study(tmp_path)
    few = tuple(replace(cell, outcomes=cell.outcomes[:2]) for cell in study.reference_grid.cells)
    made = section(replace(study, grids={"plywood": replace(study.reference_grid, cells=few)}))
    assert [finding.verdict for finding in made.findings] == ["not decided"]
